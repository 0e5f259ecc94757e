#include "features/feature_types.h"

namespace tessera {

namespace {

Result<> CheckRange(const char* name, int value, int lowest, int highest) {
  if (value >= lowest && value <= highest) return {};
  return Failed(std::string(name) + " = " + std::to_string(value) + " is not between " + std::to_string(lowest) +
                " and " + std::to_string(highest));
}

void MoveRightColumns(const CameraCalibration& from, const CameraCalibration& to, std::vector<Keypoint>& keypoints) {
  for (Keypoint& keypoint : keypoints) {
    if (keypoint.right_x_px < 0.0F) continue;
    const Eigen::Vector2d pixel(keypoint.x_px, keypoint.y_px);
    keypoint.right_x_px += static_cast<float>(RightShiftAt(to, pixel) - RightShiftAt(from, pixel));
  }
}

}  // namespace

Result<> FeatureOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(CheckRange("num_features", num_features, 1, kMaxFeatures));
  TESSERA_RETURN_IF_FAILED(CheckRange("num_levels", num_levels, 1, kMaxLevels));
  TESSERA_RETURN_IF_FAILED(CheckRange("min_score", min_score, 1, kMaxScore));
  return CheckRange("max_disparity_px", max_disparity_px, 1, kMaxDisparityPx);
}

FeatureFrame WithLens(FeatureFrame features, const LensCorrection& lens) {
  const CameraCalibration seen = features.calibration;
  features.calibration = WithLens(seen, lens);
  if (features.calibration.right_shift != seen.right_shift) {
    MoveRightColumns(seen, features.calibration, features.keypoints);
  }
  if (features.calibration.radial == seen.radial) return features;
  for (Keypoint& keypoint : features.keypoints) {
    const Eigen::Vector2d pixel = BeforeLens(seen, seen.radial, {keypoint.x_px, keypoint.y_px});
    const Eigen::Vector2d moved = MovedByLens(seen, features.calibration.radial, pixel);
    keypoint.x_px = static_cast<float>(moved.x());
    keypoint.y_px = static_cast<float>(moved.y());
  }
  return features;
}

}  // namespace tessera
