// Keyframe culling: keyframes whose landmarks others observe just as well leave the map, which so grows with the area
// explored and not with the time spent there. As in ORB-SLAM (Mur-Artal et al. 2015).
//
// A map that lasts is visited again and again, and no two visits find the same corners: by that rule, keyframes of a
// further visit would hardly ever go. They go where earlier visits know most of what they show, unless they alone hold
// their neighbors together. What an earlier visit left is never given up for what a later one sees, which may leave
// the map in turn: by taking turns, visits would wear the map out.
#pragma once

#include <cstdint>
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

// By landmark: the n-th finest pyramid level at which a keyframe observes it. On a long straight road a keyframe shares
// far points with hundreds of others, which all look at their landmarks at each step: asked of the map, half of the
// mapper's time after 4 km.
class ObserverLevels {
 public:
  explicit ObserverLevels(int n) : n_(n) {}
  // Higher than any level if there are fewer observers.
  int Of(const Map& map, LandmarkId id);
  void Forget(LandmarkId id);

 private:
  int n_;
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

 private:
  bool IsRedundant(const Map& map, KeyframeId id);
  void Remove(KeyframeId id, RemovedKeyframes& removed, MapEditor& editor);

  KeyframeCullingOptions options_;
  Visits visits_;
  ObserverLevels levels_;
};

}  // namespace tessera
