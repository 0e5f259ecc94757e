// Matches between two frames whose relative pose is known, along epipolar lines.
#pragma once

#include <span>
#include <vector>

#include "geometry/rigid3.h"
#include "tracking/matching.h"

namespace tessera {

struct EpipolarOptions {
  double min_depth = 0.1;      // nearest depth in the first camera that is searched for, map units
  double max_distance = 1.96;  // from the epipolar line, in standard deviations of the keypoint (95 %)
  MatchingOptions matching;
};

// For each keypoint of `of_first` the keypoint of `second` nearest in descriptor among those marked in
// `is_free_in_second` (by keypoint) that lie by the image of its ray from min_depth to infinity, at a pyramid level that
// differs by two at most.
std::vector<Match> MatchAlongEpipolarLines(const FrameView& first, std::span<const int32_t> of_first,
                                           const FrameView& second, std::span<const char> is_free_in_second,
                                           const Rigid3& second_from_first, const EpipolarOptions& options);

}  // namespace tessera
