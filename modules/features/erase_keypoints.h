// Leaving out some of a frame's keypoints.
#pragma once

#include <cstddef>

#include "features/feature_types.h"

namespace tessera {

// With their descriptors: those for which `is_out(i)`, their index before, holds. The others keep their order.
template <class IsOut>
void EraseKeypoints(FeatureFrame& features, IsOut is_out) {
  size_t num = 0;
  for (size_t i = 0; i < features.keypoints.size(); ++i) {
    if (is_out(i)) continue;
    features.keypoints[num] = features.keypoints[i];
    features.descriptors[num++] = features.descriptors[i];
  }
  features.keypoints.resize(num);
  features.descriptors.resize(num);
}

}  // namespace tessera
