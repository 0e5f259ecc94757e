// Keyframe culling: keyframes whose landmarks others observe just as well leave the map, which so grows with the area
// explored and not with the time spent there. As in ORB-SLAM (Mur-Artal et al. 2015). A map that was loaded grows only
// where something is new: no two visits find the same corners, so that the keyframes of a further one would hardly ever
// be redundant by the landmarks that they share with others.
#pragma once

#include "core/result.h"
#include "map/map_editor.h"
#include "map/removed_keyframes.h"

namespace tessera {

struct KeyframeCullingOptions {
  double redundant_share = 0.9;  // a keyframe is redundant if more than this share of its landmarks ...
  int redundant_observers = 3;   // ... has so many other observers, on a pyramid level at most one coarser
  double known_share = 0.5;      // ... or if more than this share was known before the map was loaded
  int min_observers = 3;         // that must be left then of a new landmark
  int kept_newest = 3;           // the newest keyframes stay: their neighbors are yet to come

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Where what came after the map was loaded begins; invalid: it wasn't loaded.
struct FirstNew {
  KeyframeId keyframe;
  LandmarkId landmark;
};

// Removes the redundant keyframes among those that share landmarks with `center`. Their children pass to their parents,
// and `removed` remembers where they were. Roots of the spanning tree stay, and so do keyframes that closed a loop.
// With one that the loaded map knew, new landmarks go of which too few observers are left.
void CullKeyframes(KeyframeId center, const FirstNew& first_new, const KeyframeCullingOptions& options,
                   RemovedKeyframes& removed, MapEditor& editor);

}  // namespace tessera
