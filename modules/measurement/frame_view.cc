#include "measurement/frame_view.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

FeatureFrame WithPairsOnly(FeatureFrame features) {
  const size_t size = std::min(features.keypoints.size(), features.descriptors.size());
  features.keypoints.resize(size);
  features.descriptors.resize(size);
  return features;
}

double BaselineOf(const CameraCalibration& calibration, double rgbd_baseline_m) {
  switch (calibration.sensor) {
    case SensorType::kStereo:
      return calibration.baseline_m;
    case SensorType::kRgbd:
      return rgbd_baseline_m;
    case SensorType::kMono:
      break;
  }
  return 0.0;
}

}  // namespace

FrameView::FrameView(FeatureFrame features, double sigma_px, double rgbd_baseline_m)
    : features_(WithPairsOnly(std::move(features))),
      grid_(features_.keypoints, features_.calibration.width_px, features_.calibration.height_px),
      sigma_px_(sigma_px),
      baseline_m_(BaselineOf(features_.calibration, rgbd_baseline_m)) {}

double FrameView::right_x_px(int i) const {
  const Keypoint& k = keypoint(i);
  if (calibration().sensor == SensorType::kStereo) {
    return k.right_x_px >= 0.0F && k.right_x_px < k.x_px ? k.right_x_px : kNoColumn;
  }
  if (calibration().sensor == SensorType::kRgbd && k.depth_m > 0.0F) {
    return k.x_px - calibration().fx_px * baseline_m_ / k.depth_m;
  }
  return kNoColumn;
}

PixelObservation FrameView::observation(int i) const { return {pixel(i), right_x_px(i), sigma_px(keypoint(i).level)}; }

}  // namespace tessera
