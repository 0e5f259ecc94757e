// What lies around a tracked frame in the map: the points that it should see besides those that it does.
#pragma once

#include <vector>

#include "matching/point_matching.h"
#include "tracking/map_replica.h"

namespace tessera {

// The keyframes that share most points with the frame, two thirds of `max_keyframes` at most, and then those that are
// covisible with them, as long as there is room. Most shared points first; ties go to the lower id.
std::vector<KeyframeId> LocalKeyframes(const Map& map, const TrackedFrame& frame, int max_keyframes);

// The landmarks of the local keyframes, and the points of keyframes that were not answered yet, that the frame does not
// see.
KnownPoints LocalPoints(const MapReplica& replica, const TrackedFrame& frame, int max_keyframes);

}  // namespace tessera
