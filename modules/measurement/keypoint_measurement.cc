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

std::optional<Eigen::Vector3d> PointFromDepth(const FeatureFrame& features, int32_t keypoint) {
  return PointFromDisparity(features.calibration, Baseline(features.calibration), SeenAt(features, keypoint));
}

}  // namespace tessera
