#include "datasets/camera_rig.h"

#include <cmath>

namespace tessera {

std::optional<LensModel> ParseLensModel(const std::string& name) {
  for (const char* known : {"radial-tangential", "radtan", "plumb_bob", "rational_polynomial"}) {
    if (name == known) return LensModel::kRadialTangential;
  }
  if (name == "equidistant" || name == "fisheye") return LensModel::kEquidistant;
  return std::nullopt;
}

Result<> PinholeCamera::Check() const {
  if (!(fx_px > 0.0) || !(fy_px > 0.0) || !std::isfinite(fx_px) || !std::isfinite(fy_px)) {
    return Failed("focal lengths must be positive");
  }
  if (!std::isfinite(cx_px) || !std::isfinite(cy_px)) {
    return Failed("the principal point must be finite");
  }
  if (width_px < 0 || height_px < 0 || (width_px == 0) != (height_px == 0)) {
    return Failed("width and height must both be positive or both be left out");
  }
  const size_t count = distortion.size();
  if (lens == LensModel::kEquidistant) {
    return count == 4
               ? Result<>()
               : Failed("equidistant distortion must have 4 numbers (k1 k2 k3 k4), not " + std::to_string(count));
  }
  if (count != 0 && count != 4 && count != 5 && count != 8) {
    return Failed("distortion must have 4, 5 or 8 numbers (k1 k2 p1 p2 k3 k4 k5 k6), not " + std::to_string(count));
  }
  return {};
}

Result<> CameraRig::Check(SensorType sensor) const {
  TESSERA_RETURN_IF_FAILED(left.Check());
  if (sensor == SensorType::kRgbd && !(depth_unit_m > 0.0 && std::isfinite(depth_unit_m))) {
    return Failed("the depth unit (meters per count) must be given and positive");
  }
  if (sensor != SensorType::kStereo) {
    return {};
  }
  if (!right) {
    return Failed("the right camera of the pair is missing");
  }
  if (const Result<> checked = right->Check(); !checked) return Failed("right camera: " + checked.error().sentence);
  if (left.width_px != right->width_px || left.height_px != right->height_px) {
    return Failed("left and right images must be of one size");
  }
  if (!(right_from_left.translation.norm() > 0.0)) {
    return Failed("the cameras of the pair must not have the same position");
  }
  return {};
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
