#include "geometry/camera.h"

#include <cmath>

namespace tessera {

std::string ToString(SensorType sensor) {
  switch (sensor) {
    case SensorType::kMono:
      return "mono";
    case SensorType::kStereo:
      return "stereo";
    case SensorType::kRgbd:
      return "rgbd";
  }
  return "unknown";
}

Result<> CameraCalibration::Check() const {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (width_px <= 0 || height_px <= 0 || width_px > 16384 || height_px > 16384) {
    return Failed("the image size " + std::to_string(width_px) + "x" + std::to_string(height_px) +
                  " px is not between 1 and 16384");
  }
  if (!positive(fx_px) || !positive(fy_px) || !std::isfinite(cx_px) || !std::isfinite(cy_px)) {
    return Failed("focal lengths must be positive and the principal point finite");
  }
  if (sensor != SensorType::kMono && sensor != SensorType::kStereo && sensor != SensorType::kRgbd) {
    return Failed("the sensor type " + std::to_string(static_cast<int>(sensor)) + " does not exist");
  }
  if (sensor == SensorType::kStereo && !positive(baseline_m)) {
    return Failed("a stereo camera needs a positive baseline");
  }
  if (sensor == SensorType::kRgbd && !positive(depth_unit_m)) {
    return Failed("an RGB-D camera needs a positive depth unit");
  }
  return {};
}

double RightShiftAt(const CameraCalibration& calibration, const Eigen::Vector2d& pixel) {
  const RightShift& shift = calibration.right_shift;
  const double half_width_px = 0.5 * calibration.width_px;
  const double x = (pixel.x() - calibration.cx_px) / half_width_px, y = (pixel.y() - calibration.cy_px) / half_width_px;
  return shift.center_px + shift.across_px * x + shift.down_px * y + shift.bend_px * x * x;
}

Eigen::Vector2d MovedByLens(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d center(calibration.cx_px, calibration.cy_px);
  const double half_width_px = 0.5 * calibration.width_px;
  return pixel + radial * (pixel - center).squaredNorm() / (half_width_px * half_width_px) * (pixel - center);
}

Eigen::Vector2d BeforeLens(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& moved) {
  const Eigen::Vector2d from_center = moved - Eigen::Vector2d(calibration.cx_px, calibration.cy_px);
  const double distance = from_center.norm() / (0.5 * calibration.width_px);
  if (radial == 0.0 || distance == 0.0) return moved;
  constexpr int kNumSteps = 5;  // Newton's, of r + radial r^3 = distance
  double r = distance;
  for (int i = 0; i < kNumSteps; ++i) r -= (r + radial * r * r * r - distance) / (1.0 + 3.0 * radial * r * r);
  return moved + (r / distance - 1.0) * from_center;
}

}  // namespace tessera
