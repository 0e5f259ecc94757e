// Keyframe culling: keyframes whose landmarks others observe just as well leave the map, which so grows with the area
// explored and not with the time spent there. As in ORB-SLAM (Mur-Artal et al. 2015).
//
// A map that lasts is visited again and again, and no two visits find the same corners: by that rule, keyframes of a
// further visit would hardly ever go. They go where earlier visits know most of what they show, unless they alone hold
// their neighbors together. What an earlier visit left is never given up for what a later one sees, which may leave
// the map in turn: by taking turns, visits would wear the map out.
#pragma once

#include "core/result.h"
#include "map/map_editor.h"
#include "map/removed_keyframes.h"

namespace tessera {

struct KeyframeCullingOptions {
  double redundant_share = 0.9;  // a keyframe is redundant if more than this share of its landmarks ...
  int redundant_observers = 3;   // ... has so many other observers, on a pyramid level at most one coarser
  double known_share = 0.5;      // or if earlier visits observe more than this share, at such a level
  int min_tie = 30;     // shared landmarks by which neighbors must still hang together: twice a neighbor's least
  int kept_newest = 3;  // the newest keyframes stay: their neighbors are yet to come

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Removes the redundant keyframes among those that share landmarks with `center`. Their children pass to their parents,
// and `removed` remembers where they were. Roots of the spanning tree stay, and so do keyframes that closed a loop.
// Cameras count their frames from the start of a run: where the numbers fall back, another visit begins.
void CullKeyframes(KeyframeId center, const KeyframeCullingOptions& options, RemovedKeyframes& removed,
                   MapEditor& editor);

}  // namespace tessera
