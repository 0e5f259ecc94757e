#include "map/removed_keyframes.h"

#include <set>

namespace tessera {
namespace {

// world_from_keyframe, from the first of its ancestors that `find` knows.
template <class Links, class FindPose>
std::optional<Sim3> FollowLinks(const Links& links, KeyframeId id, FindPose find) {
  Sim3 ancestor_from_keyframe;
  while (true) {
    if (const std::optional<Sim3> world_from_ancestor = find(id)) return *world_from_ancestor * ancestor_from_keyframe;
    const auto link = links.find(id);
    if (link == links.end()) return std::nullopt;
    ancestor_from_keyframe = link->second.parent_from_keyframe * ancestor_from_keyframe;
    id = link->second.parent;
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
    links_[id] = {keyframe->parent, world_from_parent->Inverse() * keyframe->WorldFromKeyframe()};
  }
}

void RemovedKeyframes::Add(const KeyframeLink& link) {
  for (KeyframeId id = link.parent; id != link.keyframe; id = links_.at(id).parent) {
    if (links_.contains(id)) continue;
    links_.try_emplace(link.keyframe, link.parent, link.parent_from_keyframe);
    return;
  }
}

std::optional<Sim3> RemovedKeyframes::Find(const Map& map, KeyframeId id) const {
  return FollowLinks(links_, id, [&](KeyframeId ancestor) -> std::optional<Sim3> {
    const Keyframe* keyframe = map.FindKeyframe(ancestor);
    return keyframe == nullptr ? std::nullopt : std::optional(keyframe->WorldFromKeyframe());
  });
}

KeyframeId RemovedKeyframes::Successor(const Map& map, KeyframeId id) const {
  while (id.valid() && map.FindKeyframe(id) == nullptr) {
    const auto link = links_.find(id);
    id = link == links_.end() ? KeyframeId{} : link->second.parent;
  }
  return id;
}

void KeyframePoses::Begin(const Map& map) {
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) { Set(map, id); });
}

RemovedInDelta KeyframePoses::Update(const MapDelta& delta, const Map& map) {
  RemovedInDelta removed{delta.number, {}};
  for (const KeyframeId id : delta.removed_keyframes) Link(id, &removed);
  for (const KeyframeId id : delta.removed_keyframes) poses_.erase(id);
  for (const auto& keyframe : delta.new_keyframes) Set(map, keyframe.id);
  for (const auto& moved : delta.moved_keyframes) Set(map, moved.id);
  for (const auto& child : delta.changed_parents) Set(map, child.id);
  return removed;
}

void KeyframePoses::Set(const Map& map, KeyframeId id) {
  if (const Keyframe* keyframe = map.FindKeyframe(id)) poses_[id] = {keyframe->parent, keyframe->WorldFromKeyframe()};
}

// As RemovedKeyframes::Remember does.
void KeyframePoses::Link(KeyframeId id, RemovedInDelta* removed) {
  const auto pose = poses_.find(id);
  if (pose == poses_.end()) return;
  if (const std::optional<Sim3> world_from_parent = Find(pose->second.parent)) {
    const KeyframeLink link{id, pose->second.parent, world_from_parent->Inverse() * pose->second.world_from_keyframe};
    links_[id] = link;
    removed->links.push_back(link);
  }
}

std::optional<Sim3> KeyframePoses::Find(KeyframeId id) const {
  return FollowLinks(links_, id, [&](KeyframeId ancestor) -> std::optional<Sim3> {
    const auto pose = poses_.find(ancestor);
    return pose == poses_.end() ? std::nullopt : std::optional(pose->second.world_from_keyframe);
  });
}

}  // namespace tessera
