#include "map/removed_keyframes.h"

#include <set>

namespace tessera {

void RemovedKeyframes::Remember(const Map& map, const MapDelta& delta) {
  for (const KeyframeId id : delta.removed_keyframes) {
    Remember(map, id);
  }
  if (!delta.is_snapshot) return;
  std::set<KeyframeId> kept;
  for (const MapDelta::NewKeyframe& keyframe : delta.new_keyframes) kept.insert(keyframe.id);
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) {
    if (!kept.contains(id)) Remember(map, id);
  });
}

void RemovedKeyframes::Remember(const Map& map, KeyframeId id) {
  const Keyframe* keyframe = map.FindKeyframe(id);
  if (keyframe == nullptr) return;
  if (const std::optional<Sim3> world_from_parent = Find(map, keyframe->parent)) {
    ties_[id] = {keyframe->parent, world_from_parent->Inverse() * keyframe->WorldFromKeyframe()};
  }
}

std::optional<Sim3> RemovedKeyframes::Find(const Map& map, KeyframeId id) const {
  Sim3 ancestor_from_keyframe;
  while (true) {
    if (const Keyframe* keyframe = map.FindKeyframe(id); keyframe != nullptr) {
      return keyframe->WorldFromKeyframe() * ancestor_from_keyframe;
    }
    const auto tie = ties_.find(id);
    if (tie == ties_.end()) return std::nullopt;
    ancestor_from_keyframe = tie->second.parent_from_keyframe * ancestor_from_keyframe;
    id = tie->second.parent;
  }
}

KeyframeId RemovedKeyframes::Successor(const Map& map, KeyframeId id) const {
  while (id.valid() && map.FindKeyframe(id) == nullptr) {
    const auto tie = ties_.find(id);
    id = tie == ties_.end() ? KeyframeId{} : tie->second.parent;
  }
  return id;
}

}  // namespace tessera
