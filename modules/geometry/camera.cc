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

}  // namespace tessera
