// The map as the tracker sees it: the replica that deltas made, and the keyframes that it sent and no delta has
// answered yet, with the points that the tracker triangulated itself.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "map/map.h"
#include "map/removed_keyframes.h"
#include "matching/point_id.h"

namespace tessera {

// A keyframe on its way to the mapper.
struct SentKeyframe {
  KeyframeId reference;                // invalid: the first of a map part
  Rigid3 reference_from_camera;        // in the reference's units; world_from_camera for the first of a map part
  std::map<int32_t, Landmark> points;  // by keypoint, in the keyframe's frame and units
};

class MapReplica {
 public:
  // As Map::Apply. The keyframe that the delta answers is no longer on its way.
  Result<> Apply(const MapDelta& delta);
  void Send(KeyframeId id, SentKeyframe keyframe) { sent_[id] = std::move(keyframe); }

  const Map& map() const { return map_; }
  const std::map<KeyframeId, SentKeyframe>& sent() const { return sent_; }

  // Keyframe::WorldFromKeyframe of a keyframe of the map, one that was removed from it, or one on its way, which has
  // the units of its reference.
  std::optional<Sim3> WorldFromKeyframe(KeyframeId id) const;
  // The root of the map part of such a keyframe. Invalid if it never was.
  KeyframeId PartOf(KeyframeId id) const;
  // The point in world coordinates; nullopt if it is gone.
  std::optional<Landmark> Find(const PointId& id) const;
  // The same point under its present name: its landmark once the mapper answered. Invalid if it is gone.
  PointId Renew(const PointId& id) const;
  // The points of all unanswered keyframes, in world coordinates.
  std::vector<std::pair<PointId, Landmark>> SentPoints() const;

 private:
  Map map_;
  RemovedKeyframes removed_;
  std::map<KeyframeId, SentKeyframe> sent_;
};

}  // namespace tessera
