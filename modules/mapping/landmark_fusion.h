// Fusion of duplicate landmarks: those of one and the same point, found by projecting them into the keyframes around.
#pragma once

#include <set>
#include <vector>

#include "core/result.h"
#include "map/map_editor.h"

namespace tessera {

struct FusionOptions {
  int max_neighbors = 10;        // keyframes that share most landmarks with the new one
  int max_second_neighbors = 5;  // of each of those, the ones that share most with it
  double radius_px = 3.0;        // of the search, at level 0; times the scale of the level
  int max_hamming = 50;          // bits of 256

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Projects the landmarks of `keyframe` into its neighbors, and theirs into it. Where a keypoint agrees with the
// projection (chi-square, level, descriptor), it becomes an observation of the landmark; if it observes another one
// already, the two are merged into the one with more observations (if equal, the older).
void FuseLandmarks(KeyframeId keyframe, const FusionOptions& options, MapEditor& editor);

// Projects `landmarks` into each of `targets` in the same way; for a revisited place, which has its landmarks twice.
void ProjectLandmarks(const std::set<KeyframeId>& targets, const std::vector<LandmarkId>& landmarks,
                      const FusionOptions& options, MapEditor& editor);

}  // namespace tessera
