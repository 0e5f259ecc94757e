// Keypoints in messages, whole or a part of them: what FEATURES, KEYFRAME and the map's keyframes have in common.
#pragma once

#include <cstddef>
#include <string>

#include "features/feature_types.h"
#include "tessera/keypoints_t.hpp"

namespace tessera {

// On the wire.
inline constexpr size_t kBytesPerKeypoint = 4 + 4 + 1 + 1 + 4 + 4 + 4 + 32;

// Everything but the keypoints themselves.
void SetFrame(const FeatureFrame& frame, keypoints_t* message);
// Keypoints first .. first + num - 1.
void FillKeypoints(const FeatureFrame& frame, size_t first, size_t num, keypoints_t* message);

// Takes one part in. `begins`: the first, which sets *frame anew. Empty, or what is wrong with it.
std::string JoinKeypoints(const keypoints_t& message, bool begins, FeatureFrame* frame);
// Whether all keypoints of which `message` is a part have come.
inline bool HasAllKeypoints(const keypoints_t& message, const FeatureFrame& frame) {
  return message.num_total == static_cast<int64_t>(frame.keypoints.size());
}

}  // namespace tessera
