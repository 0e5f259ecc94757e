#include "mapping/map_correction.h"

#include <set>
#include <vector>

#include "map/neighborhood.h"
#include "map/spanning_tree.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

// The given corrections, and those that their descendants take over.
Corrections WithDescendants(const Map& map, const Corrections& given) {
  Corrections all = given;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    if (given.contains(id)) return;
    for (KeyframeId ancestor = keyframe.parent; ancestor.valid(); ancestor = map.FindKeyframe(ancestor)->parent) {
      if (const auto found = given.find(ancestor); found != given.end()) {
        all.emplace(id, found->second);
        return;
      }
    }
  });
  return all;
}

// The loop's keyframe observes the landmarks of the first visit; its own duplicates are merged into them.
void ObserveFirstVisit(const LoopResult& loop, MapEditor& editor) {
  const Map& map = editor.map();
  for (const SeenLandmark& seen : loop.seen) {
    const Keyframe& keyframe = *map.FindKeyframe(loop.answers);
    if (map.FindLandmark(seen.landmark) == nullptr || static_cast<size_t>(seen.keypoint) >= keyframe.landmarks.size()) {
      continue;
    }
    const LandmarkId own = keyframe.landmarks[static_cast<size_t>(seen.keypoint)];
    if (own == seen.landmark) continue;
    if (own.valid()) {
      editor.MergeLandmarks(own, seen.landmark);
      continue;
    }
    if (!map.IsSeenBy(seen.landmark, loop.answers)) editor.AddObservation(seen.landmark, {loop.answers, seen.keypoint});
  }
}

// Where the loop joins two parts of the map, the tree of the younger root hangs below the other.
void JoinTrees(const LoopResult& loop, MapEditor& editor) {
  const Map& map = editor.map();
  const KeyframeId current_root = RootOf(map, loop.answers), matched_root = RootOf(map, loop.matched);
  if (current_root > matched_root) AttachTree(loop.answers, loop.matched, editor);
  if (current_root < matched_root) AttachTree(loop.matched, loop.answers, editor);
}

// Landmarks that both visits created become one.
void FuseVisits(const LoopResult& loop, const LoopFusionOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  const std::vector<KeyframeId> older = KeyframesAround(map, loop.matched, options.num_neighbors);
  const std::vector<KeyframeId> around_current = KeyframesAround(map, loop.answers, options.num_neighbors);
  std::set<KeyframeId> newer(around_current.begin(), around_current.end());
  const std::vector<LandmarkId> older_landmarks = LandmarksSeenBy(map, older);
  ObserveFirstVisit(loop, editor);
  for (const KeyframeId id : older) newer.erase(id);
  ProjectLandmarks(newer, older_landmarks, options.search, editor);
}

}  // namespace

void ApplyCorrections(const Corrections& given, MapEditor& editor) {
  const Map& map = editor.map();
  const Corrections corrections = WithDescendants(map, given);
  std::vector<std::pair<LandmarkId, Landmark>> moved;
  map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const std::vector<Observation>& observations = map.ObservationsOf(id);
    const auto found = observations.empty() ? corrections.end() : corrections.find(observations.front().keyframe);
    if (found == corrections.end()) return;
    moved.emplace_back(id, InWorld(found->second, landmark));
  });
  for (const auto& [id, landmark] : moved) editor.ChangeLandmark(id, landmark);
  for (const auto& [id, new_world_from_old] : corrections) {
    if (const Keyframe* keyframe = map.FindKeyframe(id)) {
      editor.MoveKeyframe(id, new_world_from_old * keyframe->WorldFromKeyframe());
    }
  }
}

void CloseLoop(const LoopResult& loop, const LoopFusionOptions& options, MapEditor& editor) {
  Corrections corrections;
  for (const LoopResult::Correction& correction : loop.corrections) {
    corrections.emplace(correction.id, correction.new_world_from_old);
  }
  ApplyCorrections(corrections, editor);
  JoinTrees(loop, editor);
  FuseVisits(loop, options, editor);
  editor.AddClosedLoop(
      {loop.answers, loop.matched, loop.matched_from_current.scale, static_cast<int32_t>(loop.seen.size())});
}

AdjustmentBase TakeBase(const Map& map) {
  AdjustmentBase base;
  map.keyframes().ForEach(
      [&](KeyframeId id, const Keyframe& keyframe) { base.world_from_camera.emplace(id, keyframe.world_from_camera); });
  map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    base.positions_in_world.emplace(id, landmark.position_in_world);
  });
  return base;
}

void ApplyAdjustment(const GlobalAdjustment& adjustment, const AdjustmentBase& base, MapEditor& editor) {
  const Map& map = editor.map();
  Corrections corrections;
  for (const GlobalAdjustment::Pose& pose : adjustment.poses) {
    const auto old = base.world_from_camera.find(pose.id);
    if (old == base.world_from_camera.end()) continue;
    corrections.emplace(pose.id, Sim3::From(pose.world_from_camera * old->second.Inverse()));
  }
  std::map<LandmarkId, Eigen::Vector3d> adjusted;  // of those that have not moved since
  for (const GlobalAdjustment::Point& point : adjustment.points) {
    const auto old = base.positions_in_world.find(point.id);
    const Landmark* landmark = map.FindLandmark(point.id);
    if (landmark != nullptr && old != base.positions_in_world.end() && old->second == landmark->position_in_world) {
      adjusted.emplace(point.id, point.position_in_world);
    }
  }
  ApplyCorrections(corrections, editor);
  for (const auto& [id, position_in_world] : adjusted) {
    Landmark landmark = *map.FindLandmark(id);
    landmark.position_in_world = position_in_world;
    editor.ChangeLandmark(id, landmark);
  }
}

}  // namespace tessera
