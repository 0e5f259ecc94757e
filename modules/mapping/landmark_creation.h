// Landmark creation at a new keyframe: from the depth of its keypoints, and by triangulation with other keyframes.
#pragma once

#include <vector>

#include "core/result.h"
#include "map/map_editor.h"
#include "matching/epipolar_search.h"
#include "measurement/depth_points.h"

namespace tessera {

struct CreationOptions {
  int max_neighbors = 10;  // keyframes searched for a second view, most shared landmarks first
  EpipolarOptions matching;
  double min_baseline_share = 0.01;  // mono: a neighbor must be this part of the median depth away to tell depths
  // Mono: with fewer landmarks than this after those neighbors, the nearer ones are searched for second views, too.
  // Where only far things are in view, hardly any neighbor is far enough away, and points of unknown depth hold the
  // rotation all the same.
  int few_landmarks = 250;
  DepthPointOptions depth;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Creates landmarks from keypoints of `keyframe` that have depth and observe no landmark yet. Returns them.
std::vector<LandmarkId> CreateFromDepth(KeyframeId keyframe, const CreationOptions& options, MapEditor& editor);

// Creates landmarks from pairs of keypoints that observe none yet, one in `keyframe` and one in a covisible keyframe
// near the first's epipolar line there (EpipolarSearch): for depths from a third of the nearest landmarks' to infinity.
// Returns the new ones.
std::vector<LandmarkId> CreateFromPairs(KeyframeId keyframe, const CreationOptions& options, MapEditor& editor);

}  // namespace tessera
