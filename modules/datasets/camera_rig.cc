#include "datasets/camera_rig.h"

#include <cmath>

namespace tessera {

std::string PinholeCamera::Check() const {
  if (!(fx_px > 0.0) || !(fy_px > 0.0) || !std::isfinite(fx_px) || !std::isfinite(fy_px)) {
    return "focal lengths must be positive";
  }
  if (!std::isfinite(cx_px) || !std::isfinite(cy_px)) {
    return "the principal point must be finite";
  }
  if (width_px < 0 || height_px < 0 || (width_px == 0) != (height_px == 0)) {
    return "width and height must both be positive or both be left out";
  }
  const size_t count = distortion.size();
  if (count != 0 && count != 4 && count != 5 && count != 8) {
    return "distortion must have 4, 5 or 8 numbers (k1 k2 p1 p2 k3 k4 k5 k6), not " + std::to_string(count);
  }
  return "";
}

std::string CameraRig::Check(SensorType sensor) const {
  if (const std::string problem = left.Check(); !problem.empty()) {
    return problem;
  }
  if (sensor == SensorType::kRgbd && !(depth_unit_m > 0.0 && std::isfinite(depth_unit_m))) {
    return "the depth unit (meters per count) must be given and positive";
  }
  if (sensor != SensorType::kStereo) {
    return "";
  }
  if (!right) {
    return "the right camera of the pair is missing";
  }
  if (const std::string problem = right->Check(); !problem.empty()) {
    return "right camera: " + problem;
  }
  if (left.width_px != right->width_px || left.height_px != right->height_px) {
    return "left and right images must be of one size";
  }
  if (!(right_from_left.translation.norm() > 0.0)) {
    return "the cameras of the pair must not have the same position";
  }
  return "";
}

CameraRig RectifiedPair(const PinholeCamera& camera, double baseline_m) {
  CameraRig rig;
  rig.left = camera;
  rig.right = camera;
  rig.right_from_left.translation = {-baseline_m, 0.0, 0.0};
  return rig;
}

bool IsRotation(const Eigen::Matrix3d& matrix) {
  return (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm() <= 1e-2 && matrix.determinant() > 0.0;
}

}  // namespace tessera
