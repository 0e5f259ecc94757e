#include "tracking/repeated_images.h"

#include <algorithm>

namespace tessera {

bool RepeatedImages::Contains(const FeatureFrame& features) {
  if (features.frame == frame_) return is_repeated_;
  // Depths may be new.
  const auto is_same = [](const Keypoint& a, const Keypoint& b) {
    return a.x_px == b.x_px && a.y_px == b.y_px && a.angle == b.angle && a.score == b.score;
  };
  is_repeated_ = !keypoints_.empty() && std::ranges::equal(features.keypoints, keypoints_, is_same);
  if (!is_repeated_) keypoints_ = features.keypoints;
  num_ += is_repeated_ ? 1 : 0;
  frame_ = features.frame;
  return is_repeated_;
}

}  // namespace tessera
