// Where keyframes stood that are no longer in the map, so that what was stored relative to them keeps its place.
#pragma once

#include <map>
#include <optional>

#include "map/map.h"

namespace tessera {

class RemovedKeyframes {
 public:
  // To be called with each delta before it is applied to `map`. Removed keyframes are tied to their parent, as it stands
  // in the map then (a parent that goes too, or has gone before, passes them on to its own). A snapshot removes all that
  // it does not hold.
  void Remember(const Map& map, const MapDelta& delta);
  // Ties one keyframe of the map to its parent.
  void Remember(const Map& map, KeyframeId id);

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

}  // namespace tessera
