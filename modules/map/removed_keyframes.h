// Where keyframes stood that are no longer in the map, so that what was stored relative to them keeps its place.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "map/map.h"

namespace tessera {

// A keyframe that is no longer in the map, and where it stood.
struct KeyframeLink {
  KeyframeId keyframe;
  KeyframeId parent;  // may be gone too
  Sim3 parent_from_keyframe;
};

// What the delta with this number removed, as those who followed the map then remember it (REMOVED_KEYFRAMES).
struct RemovedInDelta {
  int64_t delta = 0;
  std::vector<KeyframeLink> ties;
};

class RemovedKeyframes {
 public:
  // To be called with each delta before it is applied to `map`. Removed keyframes are tied to their parent, as it
  // stands in the map then (a parent that goes too, or has gone before, passes them on to its own). A snapshot removes
  // all that it does not hold.
  void Remember(const Map& map, const MapDelta& delta);
  // Ties one keyframe of the map to its parent.
  void Remember(const Map& map, KeyframeId id);
  // What was removed when nobody here followed the map. What is remembered already stays; ties in a circle are ignored.
  void Add(const KeyframeLink& tie);

  // Keyframe::WorldFromKeyframe of one that is in the map or has been there; nullopt of one that never was.
  std::optional<Sim3> Find(const Map& map, KeyframeId id) const;
  // The keyframe of the map that `id` is tied to: itself if it is there. Invalid if it never was.
  KeyframeId Successor(const Map& map, KeyframeId id) const;

 private:
  struct Tie {
    KeyframeId parent;
    Sim3 parent_from_keyframe;
  };
  std::map<KeyframeId, Tie> ties_;
};

// The owner's memory of where keyframes stood before its last delta, from which it tells what followers remember, to
// the last bit: 100 bytes for each keyframe.
class KeyframePoses {
 public:
  // `map`: the owner's, with which it begins.
  void Begin(const Map& map);
  // The owner's map changed by `delta`, and is now `map`.
  RemovedInDelta Update(const MapDelta& delta, const Map& map);

 private:
  struct Place {
    KeyframeId parent;
    Sim3 world_from_keyframe;
  };
  void Set(const Map& map, KeyframeId id);
  void Tie(KeyframeId id, RemovedInDelta* removed);
  std::optional<Sim3> Find(KeyframeId id) const;

  std::map<KeyframeId, Place> places_;
  std::map<KeyframeId, KeyframeLink> ties_;
};

}  // namespace tessera
