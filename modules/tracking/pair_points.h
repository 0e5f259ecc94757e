// Points that two frames at known poses see and the map does not have yet.
#pragma once

#include <cstdint>
#include <vector>

#include "map/map.h"
#include "matching/point_matching.h"

namespace tessera {

struct PairPoint {
  int32_t keypoint = -1;        // of the frame
  int32_t other_keypoint = -1;  // of the other one
  Landmark in_camera;           // in the frame's camera, in the world's units
};

// Pairs of keypoints that see no known point, `other` looked at along epipolar lines (EpipolarSearch) for depths from a
// third of the nearest known points' in `frame` to infinity, or from half the step, if hardly any are known. By
// keypoint of `frame`. None without a step.
//
// Two views agree on a depth whatever they see: it counts as known to half of itself at best, as in DescribeLandmark.
std::vector<PairPoint> FindPairPoints(const TrackedFrame& frame, const TrackedFrame& other);

}  // namespace tessera
