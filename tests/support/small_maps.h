// Maps of a few keyframes, made by hand.
#pragma once

#include <cstddef>
#include <memory>

#include "map/map.h"

namespace tessera {

// Keypoints that say nothing.
inline std::shared_ptr<const FeatureFrame> PlainFeatures(int64_t frame, size_t num_keypoints) {
  auto features = std::make_shared<FeatureFrame>();
  features->frame = {frame};
  features->keypoints.resize(num_keypoints);
  features->descriptors.resize(num_keypoints);
  return features;
}

// The delta as the mapper would send it: with the hash that it leads to.
inline MapDelta WithHash(const Map& map, MapDelta delta) {
  delta.number = map.next_delta();
  Map trial = map;
  (void)trial.Apply(delta);
  delta.hash = trial.hash();
  return delta;
}

}  // namespace tessera
