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

}  // namespace

FrameView::FrameView(FeatureFrame features)
    : features_(WithPairsOnly(std::move(features))),
      grid_(features_.keypoints, features_.calibration.width_px, features_.calibration.height_px),
      baseline_m_(Baseline(features_.calibration)) {}

}  // namespace tessera
