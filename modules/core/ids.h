// Identities are types, so that a keyframe's number can't be passed for a landmark's.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>

namespace tessera {

// A number that names one thing of kind `Tag`. Negative: names nothing. Ordered, so that ties break by id.
template <class Tag>
struct Id {
  int64_t value = -1;

  constexpr bool valid() const { return value >= 0; }
  constexpr auto operator<=>(const Id&) const = default;
};

// Counts the frames of the source from 0. It is the clock of the whole pipeline: dropped frames keep their number.
using FrameId = Id<struct FrameTag>;
// Counts keyframes from 0 in the order in which the tracker made them.
using KeyframeId = Id<struct KeyframeTag>;
// Names a landmark (map point).
using LandmarkId = Id<struct LandmarkTag>;

// A position that is not negative, such as a keypoint's, as an index into a vector.
constexpr size_t Index(int32_t position) { return static_cast<size_t>(position); }

}  // namespace tessera
