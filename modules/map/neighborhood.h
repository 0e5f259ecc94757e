// What lies around a keyframe: those that share landmarks with it, and what they see.
#pragma once

#include <span>
#include <vector>

#include "core/id_set.h"
#include "map/map.h"

namespace tessera {

// The keyframe, and then the `max_num` that share most landmarks with it, most first.
std::vector<KeyframeId> KeyframesAround(const Map& map, KeyframeId id, int max_num);

// The landmarks that any of the keyframes sees, each once, by id.
std::vector<LandmarkId> LandmarksSeenBy(const Map& map, std::span<const KeyframeId> keyframes);

// The keyframes, but for those in `without`, that see most of the landmarks, at most `max_num`: most first, ties by
// lower id.
std::vector<KeyframeId> BestObservers(const Map& map, std::span<const LandmarkId> landmarks,
                                      const IdSet<KeyframeId>& without, size_t max_num);

}  // namespace tessera
