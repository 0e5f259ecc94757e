#include "wire/field_conversions.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <iterator>

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little,
              "descriptors and depths are sent least significant byte first");

constexpr double kMaxCoordinate = 1e9;
constexpr double kMaxInformation = 1e18;

bool IsNear(const double (&coordinates)[3]) {
  // NaN fails the comparison.
  return std::all_of(std::begin(coordinates), std::end(coordinates),
                     [](double x) { return std::abs(x) <= kMaxCoordinate; });
}

}  // namespace

void WriteField(const std::string& text, std::string& field) {
  field = text;
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
  std::replace_if(field.begin(), field.end(), is_control, ' ');
}
Result<> ReadField(const std::string& field, std::string& text) {
  text = field;
  return {};
}

void WriteField(const Eigen::Vector3d& vector, double (&field)[3]) { std::copy(vector.begin(), vector.end(), field); }
Result<> ReadField(const double (&field)[3], Eigen::Vector3d& vector) {
  vector = {field[0], field[1], field[2]};
  return Require(IsNear(field), "a position is not finite or too far away");
}

void WriteField(const Eigen::Matrix3d& information, double (&field)[3][3]) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) field[row][column] = information(row, column);
  }
}
Result<> ReadField(const double (&field)[3][3], Eigen::Matrix3d& information) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) information(row, column) = field[row][column];
  }
  const bool is_in_range = information.allFinite() && information.cwiseAbs().maxCoeff() <= kMaxInformation &&
                           information.diagonal().minCoeff() >= 0.0 && information == information.transpose();
  return Require(is_in_range, "the information of a position is not symmetric, negative or too large");
}

void WriteField(const Matrix6d& covariance, double (&field)[6][6]) {
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) field[row][column] = covariance(row, column);
  }
}
Result<> ReadField(const double (&field)[6][6], Matrix6d& covariance) {
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) covariance(row, column) = field[row][column];
  }
  const bool is_in_range =
      covariance.allFinite() && covariance.diagonal().minCoeff() >= 0.0 && covariance == covariance.transpose();
  return Require(is_in_range, "the covariance of a pose is not finite, not symmetric or negative");
}

void WriteField(const Rigid3& transform, rigid3_t& field) {
  const Eigen::Quaterniond& q = transform.rotation;
  const double rotation_wxyz[] = {q.w(), q.x(), q.y(), q.z()};
  std::copy(std::begin(rotation_wxyz), std::end(rotation_wxyz), field.rotation_wxyz);
  WriteField(transform.translation, field.translation);
}
Result<> ReadField(const rigid3_t& field, Rigid3& transform) {
  const auto& q = field.rotation_wxyz;
  const bool is_unit = std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0) < 1e-6;
  if (!is_unit || !IsNear(field.translation)) return Failed("a pose is not finite or its quaternion not of length 1");
  transform.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  return ReadField(field.translation, transform.translation);
}

bool IsScale(double scale) { return scale > 1e-9 && scale < 1e9; }

bool IsRadial(double radial) { return std::abs(radial) <= kMaxRadial; }
bool IsRightShift(const RightShift& shift) {
  return std::abs(shift.center_px) <= kMaxRightShift_px && std::abs(shift.across_px) <= kMaxRightShift_px &&
         std::abs(shift.down_px) <= kMaxRightShift_px && std::abs(shift.bend_px) <= kMaxRightShift_px;
}

void WriteField(const Sim3& transform, sim3_t& field) {
  rigid3_t pose;
  WriteField(transform.Pose(), pose);
  field.scale = transform.scale;
  std::copy(std::begin(pose.rotation_wxyz), std::end(pose.rotation_wxyz), field.rotation_wxyz);
  std::copy(std::begin(pose.translation), std::end(pose.translation), field.translation);
}
Result<> ReadField(const sim3_t& field, Sim3& transform) {
  rigid3_t pose;
  std::copy(std::begin(field.rotation_wxyz), std::end(field.rotation_wxyz), pose.rotation_wxyz);
  std::copy(std::begin(field.translation), std::end(field.translation), pose.translation);
  Rigid3 rigid;
  TESSERA_RETURN_IF_FAILED(ReadField(pose, rigid));
  transform = Sim3::From(rigid, field.scale);
  return Require(IsScale(field.scale), "a scale is out of range");
}

void WriteField(const CameraCalibration& calibration, camera_model_t& field) {
  field.sensor = static_cast<int8_t>(calibration.sensor);
  field.width = calibration.width_px;
  field.height = calibration.height_px;
  field.fx = calibration.fx_px;
  field.fy = calibration.fy_px;
  field.cx = calibration.cx_px;
  field.cy = calibration.cy_px;
  field.baseline_m = calibration.baseline_m;
  field.depth_unit_m = calibration.depth_unit_m;
}
Result<> ReadField(const camera_model_t& field, CameraCalibration& calibration) {
  calibration = {.width_px = field.width,
                 .height_px = field.height,
                 .fx_px = field.fx,
                 .fy_px = field.fy,
                 .cx_px = field.cx,
                 .cy_px = field.cy,
                 .baseline_m = field.baseline_m,
                 .depth_unit_m = field.depth_unit_m};
  TESSERA_RETURN_IF_FAILED(ReadField(field.sensor, calibration.sensor));
  TESSERA_RETURN_IF_FAILED(Require(std::isfinite(field.baseline_m) && std::isfinite(field.depth_unit_m),
                                   "its baseline or depth unit is not finite"));
  return calibration.Check();
}

void WriteField(const FeatureOptions& options, feature_options_t& field) {
  field.num_features = options.num_features;
  field.num_levels = options.num_levels;
  field.min_score = options.min_score;
  field.max_disparity = options.max_disparity_px;
}
Result<> ReadField(const feature_options_t& field, FeatureOptions& options) {
  options = {.num_features = field.num_features,
             .num_levels = field.num_levels,
             .min_score = field.min_score,
             .max_disparity_px = field.max_disparity};
  return options.Check();
}

void WriteField(const Rect& rect, rect_t& field) {
  field.x = rect.x;
  field.y = rect.y;
  field.width = rect.width;
  field.height = rect.height;
}
Result<> ReadField(const rect_t& field, Rect& rect) {
  rect = {field.x, field.y, field.width, field.height};
  return {};
}
bool IsInside(const Rect& rect, int width, int height) {
  return rect.x >= 0 && rect.y >= 0 && rect.width >= 1 && rect.height >= 1 && rect.width <= width - rect.x &&
         rect.height <= height - rect.y;
}

void WriteField(const Descriptor& descriptor, descriptor_t& field) {
  static_assert(sizeof(field.bits) == sizeof(descriptor));
  std::memcpy(field.bits, descriptor.data(), sizeof(descriptor));
}
Result<> ReadField(const descriptor_t& field, Descriptor& descriptor) {
  std::memcpy(descriptor.data(), field.bits, sizeof(descriptor));
  return {};
}

}  // namespace tessera
