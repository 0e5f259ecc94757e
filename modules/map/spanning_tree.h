// The spanning trees of a map's keyframes, by parent: one for each part of the map.
#pragma once

#include <vector>

#include "map/map_editor.h"

namespace tessera {

// Root of the tree of keyframe `id`: names the map part that the keyframe belongs to.
KeyframeId RootOf(const Map& map, KeyframeId id);

// The root of every map part, by id.
std::vector<KeyframeId> Roots(const Map& map);

// All keyframes of that map part, by id.
std::vector<KeyframeId> MapPartOf(const Map& map, KeyframeId id);

// Makes `id` the child of `parent`, a keyframe of another tree: the links from `id` to its old root are reversed, so
// that all of its tree descends from it.
void AttachTree(KeyframeId id, KeyframeId parent, MapEditor& editor);

}  // namespace tessera
