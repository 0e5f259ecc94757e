// The keyframes and landmarks that a local bundle adjustment works on.
#pragma once

#include <vector>

#include "core/result.h"
#include "map/map.h"

namespace tessera {

struct LocalWindowOptions {
  int max_inner_keyframes = 12;   // poses that move
  int min_shared_landmarks = 15;  // a keyframe that shares fewer with the center is no neighbor (as in ORB-SLAM)
  int max_outer_keyframes = 20;   // poses that constrain the window: those that see most of its landmarks
  // Outer poses move too, constrained by their poses relative to their neighbors, and see no points (the double
  // window of Strasdat et al. 2011); else they stay, and see the window's points. stages/mapper/MEASUREMENTS.md has
  // figures.
  bool is_double = false;
  size_t num_confirming = 4;  // landmarks that fewer keyframes observe follow the poses and don't move them

  Result<> Check() const;
};

struct LocalWindow {
  std::vector<KeyframeId> inner;      // the center and its neighbors, by id
  std::vector<KeyframeId> outer;      // others that see the same landmarks, by id
  std::vector<LandmarkId> landmarks;  // seen by an inner keyframe and by two keyframes of the window at least, by id
};

// The window around `center`, a keyframe of the map.
LocalWindow SelectLocalWindow(const Map& map, KeyframeId center, const LocalWindowOptions& options);

}  // namespace tessera
