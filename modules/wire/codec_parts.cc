#include "wire/codec_parts.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little,
              "descriptors and depths are sent least significant byte first");

constexpr int64_t kMaxFrame = int64_t{1} << 53;
constexpr int64_t kMaxTimeUs = int64_t{1} << 56;
constexpr double kMaxCoordinate = 1e9;
// Bytes that an image may take at once before its pixels have come: a false size must not cost memory.
constexpr size_t kMaxReservedPixels = size_t{1} << 23;

template <class Pixel>
std::string AppendBand(const image_band_t& band, int width, int height, int8_t encoding, Image<Pixel>* image) {
  const rect_t& at = band.pixels;
  const auto row = static_cast<size_t>(width);
  const size_t num_had = image->pixels.size();
  const bool follows = at.y >= 0 && at.y < height && at.x >= 0 && at.x < width &&
                       static_cast<size_t>(at.y) * row + static_cast<size_t>(at.x) == num_had;
  const bool is_rows = at.x == 0 && at.width == width && at.height >= 1 && at.height <= height - at.y;
  const bool is_piece = at.height == 1 && at.width >= 1 && at.width <= width - at.x;
  if (!follows || !(is_rows || is_piece)) {
    return "its band of pixels does not follow the one before it or leaves the image";
  }
  const size_t num_pixels = static_cast<size_t>(at.width) * static_cast<size_t>(at.height);
  if (band.encoding != encoding || static_cast<size_t>(band.num_bytes) != num_pixels * sizeof(Pixel)) {
    return "its band has another number of bytes than its rectangle of pixels needs";
  }
  if (num_had == 0) {
    image->width = width;
    image->height = height;
    image->pixels.reserve(std::min(row * static_cast<size_t>(height), kMaxReservedPixels));
  }
  if constexpr (sizeof(Pixel) == 1) {
    image->pixels.insert(image->pixels.end(), band.data.begin(), band.data.end());
  } else {
    image->pixels.resize(num_had + num_pixels);
    std::memcpy(image->pixels.data() + num_had, band.data.data(), band.data.size());
  }
  return "";
}

}  // namespace

std::string FirstProblem(std::initializer_list<std::string> problems) {
  for (const std::string& problem : problems) {
    if (!problem.empty()) return problem;
  }
  return "";
}

std::string SentenceUnless(bool holds, const char* sentence) { return holds ? "" : sentence; }

std::string CheckFrame(int64_t frame) {
  return SentenceUnless(frame >= 0 && frame < kMaxFrame, "its frame number is out of range");
}

std::string CheckTimes(int64_t utime_us, int64_t arrival_us) {
  const auto in_range = [](int64_t time_us) { return time_us > -kMaxTimeUs && time_us < kMaxTimeUs; };
  return SentenceUnless(in_range(utime_us) && in_range(arrival_us), "its time is out of range");
}

camera_model_t ToMessage(const CameraCalibration& calibration) {
  camera_model_t message;
  message.sensor = static_cast<int8_t>(calibration.sensor);
  message.width = calibration.width_px;
  message.height = calibration.height_px;
  message.fx = calibration.fx_px;
  message.fy = calibration.fy_px;
  message.cx = calibration.cx_px;
  message.cy = calibration.cy_px;
  message.baseline_m = calibration.baseline_m;
  message.depth_unit_m = calibration.depth_unit_m;
  return message;
}

std::string FromMessage(const camera_model_t& message, CameraCalibration* calibration) {
  if (message.sensor < camera_model_t::MONO || message.sensor > camera_model_t::RGBD) {
    return "its sensor is none of mono, stereo, rgbd";
  }
  *calibration = {.sensor = static_cast<SensorType>(message.sensor),
                  .width_px = message.width,
                  .height_px = message.height,
                  .fx_px = message.fx,
                  .fy_px = message.fy,
                  .cx_px = message.cx,
                  .cy_px = message.cy,
                  .baseline_m = message.baseline_m,
                  .depth_unit_m = message.depth_unit_m};
  if (!std::isfinite(message.baseline_m) || !std::isfinite(message.depth_unit_m)) {
    return "its baseline or depth unit is not finite";
  }
  const Result<> checked = calibration->Check();
  return checked ? "" : checked.error().sentence;
}

std::string CheckScale(double scale) {
  return SentenceUnless(scale > 1e-9 && scale < 1e9, "its scale is out of range");
}

sim3_t ToMessage(const Sim3& transform) {
  const rigid3_t pose = ToMessage(transform.Pose());
  sim3_t message;
  message.scale = transform.scale;
  std::copy(std::begin(pose.rotation_wxyz), std::end(pose.rotation_wxyz), message.rotation_wxyz);
  std::copy(std::begin(pose.translation), std::end(pose.translation), message.translation);
  return message;
}

std::string FromMessage(const sim3_t& message, Sim3* transform) {
  rigid3_t pose;
  std::copy(std::begin(message.rotation_wxyz), std::end(message.rotation_wxyz), pose.rotation_wxyz);
  std::copy(std::begin(message.translation), std::end(message.translation), pose.translation);
  Rigid3 rigid;
  const std::string problem = FirstProblem({FromMessage(pose, &rigid), CheckScale(message.scale)});
  *transform = Sim3::From(rigid, message.scale);
  return problem;
}

rigid3_t ToMessage(const Rigid3& transform) {
  const Eigen::Quaterniond& q = transform.rotation;
  rigid3_t message;
  const double rotation_wxyz[] = {q.w(), q.x(), q.y(), q.z()};
  std::copy(std::begin(rotation_wxyz), std::end(rotation_wxyz), message.rotation_wxyz);
  std::copy(transform.translation.begin(), transform.translation.end(), message.translation);
  return message;
}

std::string FromMessage(const rigid3_t& message, Rigid3* transform) {
  const auto& q = message.rotation_wxyz;
  const auto& t = message.translation;
  // NaN fails both comparisons.
  const bool is_unit = std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-6;
  const bool is_near = std::all_of(std::begin(t), std::end(t), [](double x) { return std::abs(x) <= kMaxCoordinate; });
  if (!is_unit || !is_near) {
    return "its pose is not finite or its quaternion not of length 1";
  }
  transform->rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  transform->translation = {t[0], t[1], t[2]};
  return "";
}

void ToMessage(const Eigen::Vector3d& vector, double* message) { std::copy(vector.begin(), vector.end(), message); }

bool FromMessage(const double* message, Eigen::Vector3d* vector) {
  *vector = {message[0], message[1], message[2]};
  return vector->cwiseAbs().maxCoeff() <= kMaxCoordinate && vector->allFinite();
}

feature_options_t ToMessage(const FeatureOptions& options) {
  feature_options_t message;
  message.num_features = options.num_features;
  message.num_levels = options.num_levels;
  message.min_score = options.min_score;
  message.max_disparity = options.max_disparity_px;
  return message;
}

std::string FromMessage(const feature_options_t& message, FeatureOptions* options) {
  *options = {.num_features = message.num_features,
              .num_levels = message.num_levels,
              .min_score = message.min_score,
              .max_disparity_px = message.max_disparity};
  const Result<> checked = options->Check();
  return checked ? "" : checked.error().sentence;
}

rect_t ToMessage(const Rect& rect) {
  rect_t message;
  message.x = rect.x;
  message.y = rect.y;
  message.width = rect.width;
  message.height = rect.height;
  return message;
}

std::string FromMessage(const rect_t& message, int width, int height, bool may_be_empty, Rect* rect) {
  *rect = {message.x, message.y, message.width, message.height};
  if (may_be_empty && *rect == Rect{}) {
    return "";
  }
  const bool is_inside = rect->x >= 0 && rect->y >= 0 && rect->width >= 1 && rect->height >= 1 &&
                         rect->width <= width - rect->x && rect->height <= height - rect->y;
  return SentenceUnless(is_inside, "a rectangle leaves the image");
}

descriptor_t ToMessage(const Descriptor& descriptor) {
  descriptor_t message;
  static_assert(sizeof(message.bits) == sizeof(descriptor));
  std::memcpy(message.bits, descriptor.data(), sizeof(descriptor));
  return message;
}

Descriptor FromMessage(const descriptor_t& message) {
  Descriptor descriptor;
  std::memcpy(descriptor.data(), message.bits, sizeof(descriptor));
  return descriptor;
}

BandedImage Banded(int8_t image, const GrayImage& pixels) {
  return {image, pixels.width, pixels.height, 1, pixels.pixels.data()};
}

BandedImage Banded(int8_t image, const DepthImage& pixels) {
  return {image, pixels.width, pixels.height, 2, reinterpret_cast<const uint8_t*>(pixels.pixels.data())};
}

Rect NextBand(const BandedImage& image, int x, int y, size_t max_bytes) {
  const auto pixels_per_band =
      static_cast<int>(std::max<size_t>(1, max_bytes / static_cast<size_t>(image.bytes_per_pixel)));
  const int rows = pixels_per_band / image.width;
  if (rows >= 1) {
    return {0, y, image.width, std::min(rows, image.height - y)};
  }
  return {x, y, std::min(pixels_per_band, image.width - x), 1};
}

void FillBand(const BandedImage& image, const Rect& pixels, image_band_t* band) {
  const auto pixel = static_cast<size_t>(image.bytes_per_pixel);
  const size_t first = static_cast<size_t>(pixels.y) * static_cast<size_t>(image.width) + static_cast<size_t>(pixels.x);
  const size_t num_bytes = static_cast<size_t>(pixels.width) * static_cast<size_t>(pixels.height) * pixel;
  band->image = image.image;
  band->encoding = image.bytes_per_pixel == 1 ? image_band_t::GRAY8 : image_band_t::DEPTH16;
  band->pixels = ToMessage(pixels);
  band->num_bytes = static_cast<int32_t>(num_bytes);
  band->data.assign(image.bytes + first * pixel, image.bytes + first * pixel + num_bytes);
}

std::string JoinBand(const image_band_t& band, int width, int height, GrayImage* image) {
  return AppendBand(band, width, height, image_band_t::GRAY8, image);
}

std::string JoinBand(const image_band_t& band, int width, int height, DepthImage* image) {
  return AppendBand(band, width, height, image_band_t::DEPTH16, image);
}

}  // namespace tessera
