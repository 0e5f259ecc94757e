// What lies around a keyframe: those that share landmarks with it, and what they see.
#pragma once

#include <span>
#include <vector>

#include "map/map.h"

namespace tessera {

// The keyframe, and then the `max_num` that share most landmarks with it, most first.
std::vector<KeyframeId> KeyframesAround(const Map& map, KeyframeId id, int max_num);

// The landmarks that any of the keyframes sees, each once, by id.
std::vector<LandmarkId> LandmarksSeenBy(const Map& map, std::span<const KeyframeId> keyframes);

}  // namespace tessera
