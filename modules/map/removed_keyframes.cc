#include "map/removed_keyframes.h"

#include <set>

namespace tessera {
namespace {

// world_from_keyframe, from the first of its ancestors that `find` knows.
template <class Ties, class FindPlace>
std::optional<Sim3> FollowTies(const Ties& ties, KeyframeId id, FindPlace find) {
  Sim3 ancestor_from_keyframe;
  while (true) {
    if (const std::optional<Sim3> world_from_ancestor = find(id)) return *world_from_ancestor * ancestor_from_keyframe;
    const auto tie = ties.find(id);
    if (tie == ties.end()) return std::nullopt;
    ancestor_from_keyframe = tie->second.parent_from_keyframe * ancestor_from_keyframe;
    id = tie->second.parent;
  }
}

}  // namespace

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

void RemovedKeyframes::Add(const KeyframeLink& tie) {
  for (KeyframeId id = tie.parent; id != tie.keyframe; id = ties_.at(id).parent) {
    if (ties_.contains(id)) continue;
    ties_.try_emplace(tie.keyframe, tie.parent, tie.parent_from_keyframe);
    return;
  }
}

std::optional<Sim3> RemovedKeyframes::Find(const Map& map, KeyframeId id) const {
  return FollowTies(ties_, id, [&](KeyframeId ancestor) -> std::optional<Sim3> {
    const Keyframe* keyframe = map.FindKeyframe(ancestor);
    return keyframe == nullptr ? std::nullopt : std::optional(keyframe->WorldFromKeyframe());
  });
}

KeyframeId RemovedKeyframes::Successor(const Map& map, KeyframeId id) const {
  while (id.valid() && map.FindKeyframe(id) == nullptr) {
    const auto tie = ties_.find(id);
    id = tie == ties_.end() ? KeyframeId{} : tie->second.parent;
  }
  return id;
}

void KeyframePoses::Begin(const Map& map) {
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) { Set(map, id); });
}

RemovedInDelta KeyframePoses::Update(const MapDelta& delta, const Map& map) {
  RemovedInDelta removed{delta.number, {}};
  for (const KeyframeId id : delta.removed_keyframes) Tie(id, &removed);
  for (const KeyframeId id : delta.removed_keyframes) places_.erase(id);
  for (const auto& keyframe : delta.new_keyframes) Set(map, keyframe.id);
  for (const auto& moved : delta.moved_keyframes) Set(map, moved.id);
  for (const auto& child : delta.changed_parents) Set(map, child.id);
  return removed;
}

void KeyframePoses::Set(const Map& map, KeyframeId id) {
  if (const Keyframe* keyframe = map.FindKeyframe(id)) places_[id] = {keyframe->parent, keyframe->WorldFromKeyframe()};
}

// As RemovedKeyframes::Remember does.
void KeyframePoses::Tie(KeyframeId id, RemovedInDelta* removed) {
  const auto place = places_.find(id);
  if (place == places_.end()) return;
  if (const std::optional<Sim3> world_from_parent = Find(place->second.parent)) {
    const KeyframeLink tie{id, place->second.parent, world_from_parent->Inverse() * place->second.world_from_keyframe};
    ties_[id] = tie;
    removed->ties.push_back(tie);
  }
}

std::optional<Sim3> KeyframePoses::Find(KeyframeId id) const {
  return FollowTies(ties_, id, [&](KeyframeId ancestor) -> std::optional<Sim3> {
    const auto place = places_.find(ancestor);
    return place == places_.end() ? std::nullopt : std::optional(place->second.world_from_keyframe);
  });
}

}  // namespace tessera
