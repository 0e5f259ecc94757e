// Images that come once more in place of new ones: drivers repeat them where USB or a disk is busy, and videos whose
// rate was raised have each fourth or so twice. They show where the camera was a moment ago, not where it is.
#pragma once

#include <cstdint>
#include <vector>

#include "features/feature_types.h"

namespace tessera {

class RepeatedImages {
 public:
  // Whether this is the image of the frame before: every keypoint is where it was. Noise alone moves some of them where
  // a camera stands still. Frames in the order of their numbers, each as often as needed.
  bool Contains(const FeatureFrame& features);
  int64_t num() const { return num_; }

 private:
  FrameId frame_;
  std::vector<Keypoint> keypoints_;  // of it
  bool is_repeated_ = false;         // the frame
  int64_t num_ = 0;
};

}  // namespace tessera
