// The name of a point that a frame can see.
#pragma once

#include <compare>
#include <cstdint>

#include "core/ids.h"

namespace tessera {

// A point that a frame can see: a landmark of the map, or what a keypoint of an unanswered keyframe sees.
struct PointId {
  LandmarkId landmark;
  KeyframeId keyframe;
  int32_t keypoint = -1;

  bool valid() const { return landmark.valid() || keyframe.valid(); }
  auto operator<=>(const PointId&) const = default;
};

}  // namespace tessera
