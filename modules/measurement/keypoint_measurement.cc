#include "measurement/keypoint_measurement.h"

#include "geometry/triangulation.h"

namespace tessera {

double Baseline(const CameraCalibration& calibration) {
  switch (calibration.sensor) {
    case SensorType::kMono:
      return 0.0;
    case SensorType::kStereo:
      return calibration.baseline_m;
    case SensorType::kRgbd:
      return kRgbdBaseline;
  }
  return 0.0;
}

PixelObservation SeenAt(const FeatureFrame& features, int32_t keypoint) {
  const Keypoint& k = features.keypoints[static_cast<size_t>(keypoint)];
  PixelObservation seen{{k.x_px, k.y_px}, kNoColumn, kKeypointSigmaPx * LevelScale(k.level)};
  if (features.calibration.sensor == SensorType::kStereo) {
    seen.right_x_px = k.right_x_px >= 0.0F && k.right_x_px < k.x_px ? k.right_x_px : kNoColumn;
  } else if (features.calibration.sensor == SensorType::kRgbd && k.depth_m > 0.0F) {
    seen.right_x_px = k.x_px - features.calibration.fx_px * kRgbdBaseline / k.depth_m;
    seen.disparity_sigma_px = kRgbdDisparitySigmaPx;
  }
  return seen;
}

std::optional<Eigen::Vector3d> PointFromDepth(const FeatureFrame& features, int32_t keypoint) {
  return PointFromDisparity(features.calibration, Baseline(features.calibration), SeenAt(features, keypoint));
}

}  // namespace tessera
