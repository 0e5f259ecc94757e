// Links from keyframes that are no longer in the map to those that are, so that poses stored relative to removed
// keyframes stay valid.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "map/map.h"

namespace tessera {

// A keyframe that is no longer in the map, and its pose relative to its parent.
struct KeyframeLink {
  KeyframeId keyframe;
  KeyframeId parent;  // may be gone too
  Sim3 parent_from_keyframe;
};

// What the delta with this number removed, as links that its followers hold (REMOVED_KEYFRAMES).
struct RemovedInDelta {
  int64_t delta = 0;
  std::vector<KeyframeLink> links;
};

class RemovedKeyframes {
 public:
  // To be called with each delta before it is applied to `map`. Links removed keyframes to their parent, at its pose in
  // the map then (a parent that is removed too, or was before, is followed to its own); the root of a part that the
  // same delta joins to another one, to a keyframe of the part that stays. A snapshot removes all that it does not
  // hold.
  void Remember(const Map& map, const MapDelta& delta);
  // Links one keyframe of the map to its parent.
  void Remember(const Map& map, KeyframeId id);
  // A link that was made before this follower joined. One that is known already stays; a link that closes a circle is
  // ignored.
  void Add(const KeyframeLink& link);

  // Of one that is no longer in the map; nullopt: it has none.
  std::optional<KeyframeLink> LinkOf(KeyframeId id) const;
  // Keyframe::WorldFromKeyframe of one that is in the map or has been there; nullopt of one that never was.
  std::optional<Sim3> Find(const Map& map, KeyframeId id) const;
  // The keyframe of the map that `id` is linked to: itself if it is there. Invalid if it never was.
  KeyframeId Successor(const Map& map, KeyframeId id) const;

 private:
  struct Link {
    KeyframeId parent;
    Sim3 parent_from_keyframe;
  };
  void LinkTo(const Map& map, KeyframeId id, KeyframeId parent);

  std::map<KeyframeId, Link> links_;
};

// The owner's record of the keyframes' poses before its last delta, from which it makes the links that followers hold,
// bit for bit: 100 bytes for each keyframe.
class KeyframePoses {
 public:
  // `map`: the owner's, with which it begins.
  void Begin(const Map& map);
  // The owner's map changed by `delta`, and is now `map`.
  RemovedInDelta Update(const MapDelta& delta, const Map& map);

 private:
  struct Pose {
    KeyframeId parent;
    Sim3 world_from_keyframe;
  };
  void Set(const Map& map, KeyframeId id);
  void Link(KeyframeId id, const std::set<KeyframeId>& all_removed, RemovedInDelta* removed);
  std::optional<Sim3> Find(KeyframeId id) const;

  std::map<KeyframeId, Pose> poses_;
  std::map<KeyframeId, KeyframeLink> links_;
};

}  // namespace tessera
