#include "tracking/map_replica.h"

#include "map/spanning_tree.h"
#include "measurement/landmark_description.h"

namespace tessera {

Result<> MapReplica::Apply(const MapDelta& delta) {
  removed_.Remember(map_, delta);
  Result<> applied = map_.Apply(delta);
  sent_.erase(sent_.begin(), sent_.upper_bound(delta.answers));  // answered in order; a snapshot answers several
  return applied;
}

std::optional<Sim3> MapReplica::WorldFromKeyframe(KeyframeId id) const {
  Sim3 ancestor_from_keyframe;
  for (auto sent = sent_.find(id); sent != sent_.end(); sent = sent_.find(id)) {
    ancestor_from_keyframe = Sim3::From(sent->second.reference_from_camera) * ancestor_from_keyframe;
    id = sent->second.reference;
    if (!id.valid()) return ancestor_from_keyframe;
  }
  const std::optional<Sim3> world_from_ancestor = removed_.Find(map_, id);
  if (!world_from_ancestor) return std::nullopt;
  return *world_from_ancestor * ancestor_from_keyframe;
}

KeyframeId MapReplica::PartOf(KeyframeId id) const {
  for (auto sent = sent_.find(id); sent != sent_.end(); sent = sent_.find(id)) {
    if (!sent->second.reference.valid()) return id;
    id = sent->second.reference;
  }
  const KeyframeId successor = removed_.Successor(map_, id);
  return successor.valid() ? RootOf(map_, successor) : KeyframeId{};
}

std::optional<Landmark> MapReplica::Find(const PointId& id) const {
  if (id.landmark.valid()) {
    const Landmark* landmark = map_.FindLandmark(id.landmark);
    return landmark == nullptr ? std::nullopt : std::optional(*landmark);
  }
  const auto sent = sent_.find(id.keyframe);
  if (sent == sent_.end()) return std::nullopt;
  const auto point = sent->second.points.find(id.keypoint);
  const std::optional<Sim3> world_from_keyframe = WorldFromKeyframe(id.keyframe);
  if (point == sent->second.points.end() || !world_from_keyframe) return std::nullopt;
  return InWorld(*world_from_keyframe, point->second);
}

PointId MapReplica::Renew(const PointId& id) const {
  if (id.landmark.valid()) return map_.FindLandmark(id.landmark) != nullptr ? id : PointId{};
  if (sent_.contains(id.keyframe)) return id;
  const Keyframe* keyframe = map_.FindKeyframe(id.keyframe);
  return keyframe == nullptr ? PointId{} : PointId{keyframe->landmarks[static_cast<size_t>(id.keypoint)], {}, -1};
}

std::vector<std::pair<PointId, Landmark>> MapReplica::SentPoints() const {
  std::vector<std::pair<PointId, Landmark>> points;
  for (const auto& [id, keyframe] : sent_) {
    const std::optional<Sim3> world_from_keyframe = WorldFromKeyframe(id);
    if (!world_from_keyframe) continue;
    for (const auto& [keypoint, point] : keyframe.points) {
      points.emplace_back(PointId{{}, id, keypoint}, InWorld(*world_from_keyframe, point));
    }
  }
  return points;
}

}  // namespace tessera
