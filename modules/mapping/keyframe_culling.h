// Keyframe culling: keyframes whose landmarks others observe just as well leave the map, which so grows with the area
// explored and not with the time spent there. As in ORB-SLAM (Mur-Artal et al. 2015).
//
// A map that lasts is visited again and again, and no two visits find the same corners: by that rule, keyframes of a
// further visit would hardly ever go. They go where earlier visits know most of what they show, unless they alone hold
// their neighbors together. What an earlier visit left is never given up for what a later one sees, which may leave
// the map in turn: by taking turns, visits would wear the map out.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

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

// Which visit of the map made a keyframe, counted from 0. Cameras count their frames from the start of a run: where the
// numbers fall back, another visit begins.
class Visits {
 public:
  // Looks at all keyframes of the map the first time, then only at `newest`.
  void Update(const Map& map, KeyframeId newest);
  int Of(KeyframeId id) const;
  int newest() const { return static_cast<int>(begins_.size()); }

 private:
  void Add(KeyframeId id, const Keyframe& keyframe);

  std::vector<KeyframeId> begins_;  // of the second and later ones
  KeyframeId last_;
  FrameId last_frame_;
};

// By landmark: the n-th finest pyramid level at which a keyframe of the first visits, up to `last_visit`, observes it.
// On a long straight road a keyframe shares far points with hundreds of others, which all look at their landmarks at
// each step: asked of the map, half of the mapper's time after 4 km.
class ObserverLevels {
 public:
  ObserverLevels(int n, int last_visit) : n_(n), last_visit_(last_visit) {}
  // Higher than any level if there are fewer such observers.
  int Of(const Map& map, const Visits& visits, LandmarkId id);
  void Forget(LandmarkId id);

 private:
  int n_;
  int last_visit_;
  std::vector<uint8_t> levels_;  // by landmark id
};

class KeyframeCuller {
 public:
  explicit KeyframeCuller(const KeyframeCullingOptions& options);

  // Removes the redundant keyframes among those that share landmarks with `center`, the newest one. Their children pass
  // to their parents, and `removed` remembers where they were. Roots of the spanning tree stay, and so do keyframes
  // that closed a loop. Since the last call, observations may have changed only by edits of `editor`; between the
  // calls, landmarks may have been removed as well.
  void Cull(KeyframeId center, RemovedKeyframes& removed, MapEditor& editor);
  // The same when no further keyframe comes: of the newest ones only `center` must stay.
  void CullLast(KeyframeId center, RemovedKeyframes& removed, MapEditor& editor);
  // The same where Cull's changes are in the map already, with whatever else the step changed.
  void Follow(KeyframeId center, const Map& map);

 private:
  void CullUpTo(KeyframeId last, KeyframeId center, RemovedKeyframes& removed, MapEditor& editor);
  bool IsRedundant(const Map& map, KeyframeId id);
  bool AreObserved(const Map& map, KeyframeId id, double share, int num_observers, int last_visit);
  void Forget(LandmarkId id);
  void Remove(KeyframeId id, RemovedKeyframes& removed, MapEditor& editor);

  KeyframeCullingOptions options_;
  Visits visits_;
  std::map<std::pair<int, int>, ObserverLevels> levels_;  // by number of observers and last visit
};

}  // namespace tessera
