#include "mapping/map_correction.h"

#include <cmath>
#include <set>
#include <vector>

#include "map/neighborhood.h"
#include "map/spanning_tree.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

// The given corrections of keyframes of the map, and those that their descendants take over.
IdMap<KeyframeId, Sim3> WithDescendants(const Map& map, const Corrections& given) {
  IdMap<KeyframeId, Sim3> all;
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe&) {
    for (KeyframeId ancestor = id; ancestor.valid(); ancestor = map.FindKeyframe(ancestor)->parent) {
      if (const auto found = given.find(ancestor); found != given.end()) {
        all.Put(id, found->second);
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
  const IdMap<KeyframeId, Sim3> corrections = WithDescendants(map, given);
  map.landmarks().ForEach([&](LandmarkId id, const ObservedLandmark& landmark) {
    const bool is_seen = landmark.observations.size() > 0;
    const Sim3* new_world_from_old = is_seen ? corrections.Find(landmark.observations.begin()->keyframe) : nullptr;
    if (new_world_from_old != nullptr) editor.ChangeLandmark(id, InWorld(*new_world_from_old, landmark));
  });
  corrections.ForEach([&](KeyframeId id, const Sim3& new_world_from_old) {
    editor.MoveKeyframe(id, new_world_from_old * map.FindKeyframe(id)->WorldFromKeyframe());
  });
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

Corrections ScaleCorrections(const Map& map, KeyframeId keyframe, const std::vector<ScaleMending>& mendings) {
  Corrections corrections;
  Rigid3 last_pose, new_pose;  // of the keyframe before
  double factor = 1.0;         // there
  auto next = mendings.begin();
  for (const KeyframeId id : MapPartOf(map, RootOf(map, keyframe))) {
    const Rigid3& pose = map.FindKeyframe(id)->world_from_camera;
    Rigid3 last_from_this = last_pose.Inverse() * pose;
    last_from_this.translation *= factor;
    new_pose = new_pose * last_from_this;
    last_pose = pose;
    for (; next != mendings.end() && next->keyframe <= id; ++next) factor = std::exp(next->log_factor);
    if (next != mendings.begin()) corrections.emplace(id, Sim3::From(new_pose, factor) * Sim3::From(pose).Inverse());
  }
  return corrections;
}

AdjustmentBase TakeBase(const Map& map) {
  AdjustmentBase base;
  map.keyframes().ForEach(
      [&](KeyframeId id, const Keyframe& keyframe) { base.world_from_camera.Put(id, keyframe.world_from_camera); });
  map.landmarks().ForEach(
      [&](LandmarkId id, const Landmark& landmark) { base.positions_in_world.Put(id, landmark.position_in_world); });
  return base;
}

void ApplyAdjustment(const GlobalAdjustment& adjustment, const AdjustmentBase& base, MapEditor& editor) {
  const Map& map = editor.map();
  Corrections corrections;
  for (const GlobalAdjustment::Pose& pose : adjustment.poses) {
    const Rigid3* old = base.world_from_camera.Find(pose.id);
    if (old != nullptr) corrections.emplace(pose.id, Sim3::From(pose.world_from_camera * old->Inverse()));
  }
  std::vector<GlobalAdjustment::Point> adjusted;  // of those that have not moved since
  for (const GlobalAdjustment::Point& point : adjustment.points) {
    const Eigen::Vector3d* old = base.positions_in_world.Find(point.id);
    const Landmark* landmark = map.FindLandmark(point.id);
    if (landmark != nullptr && old != nullptr && *old == landmark->position_in_world) adjusted.push_back(point);
  }
  ApplyCorrections(corrections, editor);
  for (const GlobalAdjustment::Point& point : adjusted) {
    Landmark landmark = *map.FindLandmark(point.id);
    landmark.position_in_world = point.position_in_world;
    editor.ChangeLandmark(point.id, landmark);
  }
}

}  // namespace tessera
