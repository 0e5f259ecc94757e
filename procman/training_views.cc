#include "training_views.h"

#include <algorithm>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>

#include "core/errors.h"
#include "datasets/frame_source.h"
#include "datasets/image_file.h"
#include "stages/camera/log_source.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
using UseView = std::function<void(const GrayImage&, const CameraCalibration&)>;

constexpr int kMinSidePx = 200;   // below it a picture is an icon
constexpr int kMinWidthPx = 640;  // of views, as far as the photo has them: the widths of usual cameras' images
constexpr int kMaxWidthPx = 1280;

// In [low, high), from the generator's upper 53 bits: the standard leaves its own distributions open.
double Uniform(double low, double high, std::mt19937_64& generator) {
  return low + (high - low) * static_cast<double>(generator() >> 11U) * 0x1p-53;
}

// View 0 is the whole photo, the others are a random part of it of the same shape.
Rect ChooseView(const GrayImage& photo, int view, std::mt19937_64& generator) {
  if (view == 0) return {0, 0, photo.width, photo.height};
  const double share = Uniform(0.3, 0.9, generator);
  const int width = static_cast<int>(share * photo.width), height = static_cast<int>(share * photo.height);
  const int x = static_cast<int>(Uniform(0.0, photo.width - width, generator));
  const int y = static_cast<int>(Uniform(0.0, photo.height - height, generator));
  return {x, y, width, height};
}

// Made smaller to `width` pixels, never larger: no camera makes an image as smooth as a magnified one.
GrayImage Shrink(GrayImage image, int width) {
  if (width >= image.width) return image;
  GrayImage smaller(width, std::max(1, image.height * width / image.width));
  const cv::Mat from(image.height, image.width, CV_8U, image.pixels.data());
  cv::Mat to(smaller.height, smaller.width, CV_8U, smaller.pixels.data());
  cv::resize(from, to, to.size(), 0.0, 0.0, cv::INTER_AREA);
  return smaller;
}

void CutPhoto(const std::string& path, const TrainingViewOptions& options, std::mt19937_64& generator,
              const UseView& use) {
  const GrayImage photo = ReadGrayImage(path);
  for (int view = 0; view < options.num_views; ++view) {
    const Rect rect = ChooseView(photo, view, generator);
    const int width = static_cast<int>(Uniform(kMinWidthPx, kMaxWidthPx, generator));
    const GrayImage image = Shrink(Crop(photo, rect), width);
    if (std::min(image.width, image.height) < kMinSidePx) continue;
    use(image, {.width_px = image.width,
                .height_px = image.height,
                .fx_px = 0.8 * image.width,
                .fy_px = 0.8 * image.width,
                .cx_px = 0.5 * image.width,
                .cy_px = 0.5 * image.height});
  }
}

// Returns why photos were skipped.
std::vector<std::string> CutPhotosIn(const fs::path& folder, const TrainingViewOptions& options, const UseView& use) {
  std::vector<std::string> skipped;
  std::set<fs::path> folders = {folder};
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_directory()) folders.insert(entry.path());
  }
  std::mt19937_64 generator(options.seed);
  for (const fs::path& each : folders) {
    for (const std::string& path : ListImages(each)) {
      if (fs::is_symlink(path)) continue;  // another name of a photo, often of one in the same folder
      try {
        CutPhoto(path, options, generator, use);
      } catch (const InputError& error) {
        skipped.emplace_back(error.what());
      }
    }
  }
  return skipped;
}

void TakeFramesOf(const std::string& source, const TrainingViewOptions& options, const UseView& use) {
  const SourceOptions source_options{.source = source, .calibration_path = options.calibration_path};
  const auto frames = source.starts_with("log:") ? OpenLog(source_options, "") : OpenSource(source_options);
  if (frames->is_live()) throw InputError("source `" + source + "` has no end: record it, and train on the log");
  for (int64_t i = 0; auto frame = frames->Next(); ++i) {
    if (i % options.every == 0) use(frame->left, frames->calibration());
  }
}

}  // namespace

std::vector<std::string> ForEachTrainingView(const std::string& source, const TrainingViewOptions& options,
                                             const UseView& use) {
  if (fs::is_directory(source)) return CutPhotosIn(source, options, use);
  TakeFramesOf(source, options, use);
  return {};
}

}  // namespace tessera
