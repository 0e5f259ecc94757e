// What a tracked frame measured of points that are known.
#pragma once

#include <vector>

#include "matching/point_matching.h"

namespace tessera {

// Keypoints with a measured depth or right column that see a point before the camera, of which more is known than its
// direction: of all that see one, every second, third, ..., so that `max_num` are asked.
std::vector<int> MeasuredPoints(const TrackedFrame& frame, int max_num);

}  // namespace tessera
