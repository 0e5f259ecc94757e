// The spanning trees of a map's keyframes, by parent: one for each part of the map that hangs together.
#pragma once

#include <vector>

#include "map/map_editor.h"

namespace tessera {

// Root of the tree that keyframe `id` of the map stands in: names the part of the map that it belongs to.
KeyframeId RootOf(const Map& map, KeyframeId id);

// All keyframes of that part, by id.
std::vector<KeyframeId> MapPartOf(const Map& map, KeyframeId id);

// Makes `id` the child of `parent`, a keyframe of another tree, and turns its own tree round, so that all of it hangs
// below `id`.
void AttachTree(KeyframeId id, KeyframeId parent, MapEditor& editor);

}  // namespace tessera
