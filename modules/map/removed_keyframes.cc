#include "map/removed_keyframes.h"

#include <set>
#include <utility>

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

using Parents = std::map<KeyframeId, KeyframeId>;  // by keyframe; invalid: of a root

// The first keyframe of the root's tree that stays.
KeyframeId HeirOf(KeyframeId root, const Parents& parents, const std::set<KeyframeId>& removed) {
  for (const auto& [id, parent] : parents) {
    KeyframeId ancestor = id;
    for (auto next = parents.find(id); next != parents.end() && next->second.valid();) {
      ancestor = next->second;
      next = parents.find(ancestor);
    }
    if (ancestor == root && !removed.contains(id)) return id;
  }
  return {};
}

// To what the removed keyframe is linked. A root goes only if the same delta joins its part to another one: it has no
// parent yet, and its tree hangs from another keyframe afterwards.
template <class GetParents>
KeyframeId ParentOrHeir(KeyframeId id, KeyframeId parent, const std::set<KeyframeId>& removed, GetParents parents) {
  return parent.valid() ? parent : HeirOf(id, parents(), removed);
}

std::set<KeyframeId> RemovedBy(const MapDelta& delta, const Map& map) {
  std::set<KeyframeId> removed(delta.removed_keyframes.begin(), delta.removed_keyframes.end());
  if (!delta.is_snapshot) return removed;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) { removed.insert(id); });
  for (const MapDelta::NewKeyframe& keyframe : delta.new_keyframes) removed.erase(keyframe.id);
  return removed;
}

}  // namespace

void RemovedKeyframes::Remember(const Map& map, const MapDelta& delta) {
  const std::set<KeyframeId> removed = RemovedBy(delta, map);
  for (const KeyframeId id : removed) {
    const Keyframe* keyframe = map.FindKeyframe(id);
    if (keyframe == nullptr) continue;
    LinkTo(map, id, ParentOrHeir(id, keyframe->parent, removed, [&] {
             Parents parents;
             map.keyframes().ForEach([&](KeyframeId k, const Keyframe& other) { parents[k] = other.parent; });
             return parents;
           }));
  }
}

void RemovedKeyframes::Remember(const Map& map, KeyframeId id) {
  if (const Keyframe* keyframe = map.FindKeyframe(id)) LinkTo(map, id, keyframe->parent);
}

void RemovedKeyframes::LinkTo(const Map& map, KeyframeId id, KeyframeId parent) {
  if (const std::optional<Sim3> world_from_parent = Find(map, parent)) {
    links_[id] = {parent, world_from_parent->Inverse() * map.FindKeyframe(id)->WorldFromKeyframe()};
  }
}

void RemovedKeyframes::Add(const KeyframeLink& link) {
  for (KeyframeId id = link.parent; id != link.keyframe; id = links_.at(id).parent) {
    if (links_.contains(id)) continue;
    links_.try_emplace(link.keyframe, link.parent, link.parent_from_keyframe);
    return;
  }
}

std::optional<KeyframeLink> RemovedKeyframes::LinkOf(KeyframeId id) const {
  const auto link = links_.find(id);
  if (link == links_.end()) return std::nullopt;
  return KeyframeLink{id, link->second.parent, link->second.parent_from_keyframe};
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
  const std::set<KeyframeId> ids(delta.removed_keyframes.begin(), delta.removed_keyframes.end());
  for (const KeyframeId id : ids) Link(id, ids, &removed);
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
void KeyframePoses::Link(KeyframeId id, const std::set<KeyframeId>& all_removed, RemovedInDelta* removed) {
  const auto pose = poses_.find(id);
  if (pose == poses_.end()) return;
  const KeyframeId parent = ParentOrHeir(id, pose->second.parent, all_removed, [&] {
    Parents parents;
    for (const auto& [keyframe, of_keyframe] : poses_) parents[keyframe] = of_keyframe.parent;
    return parents;
  });
  if (const std::optional<Sim3> world_from_parent = Find(parent)) {
    const KeyframeLink link{id, parent, world_from_parent->Inverse() * pose->second.world_from_keyframe};
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
