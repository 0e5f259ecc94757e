#include "map/map_editor.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace tessera {

namespace {

// An edit needs no number and no hash of its own: the delta of all edits gets them.
void Check(const Result<>& applied) { ThrowIfFailed<std::logic_error>(applied, "map editor: "); }

}  // namespace

void MapEditor::AddKeyframe(KeyframeId id, KeyframeId parent, const Sim3& world_from_keyframe,
                            std::shared_ptr<const FeatureFrame> features) {
  const MapDelta::NewKeyframe added{id, parent, world_from_keyframe.Pose(), std::move(features),
                                    world_from_keyframe.scale};
  Check(map_.AddKeyframe(added));
  new_keyframes_[id] = added;
}

void MapEditor::MoveKeyframe(KeyframeId id, const Rigid3& world_from_camera) {
  MoveKeyframe(id, Sim3::From(world_from_camera, map_.FindKeyframe(id)->scale));
}

void MapEditor::MoveKeyframe(KeyframeId id, const Sim3& world_from_keyframe) {
  Check(map_.MoveKeyframe({id, world_from_keyframe.Pose(), world_from_keyframe.scale}));
  changed_poses_.Add(id);
}

void MapEditor::SetParent(KeyframeId id, KeyframeId parent) {
  Check(map_.ChangeParent({id, parent}));
  changed_parents_.Add(id);
}

void MapEditor::RemoveKeyframe(KeyframeId id) {
  const std::vector<LandmarkId> landmarks = map_.FindKeyframe(id)->landmarks;
  for (size_t i = 0; i < landmarks.size(); ++i) {
    if (landmarks[i].valid()) {
      RemoveObservation(landmarks[i], {id, static_cast<int32_t>(i)});
    }
  }
  Check(map_.RemoveKeyframe(id));
  changed_poses_.Remove(id);
  changed_parents_.Remove(id);
  if (new_keyframes_.erase(id) == 0) {
    removed_keyframes_.Add(id);
  }
}

LandmarkId MapEditor::AddLandmark(const Landmark& landmark) {
  const LandmarkId id{map_.landmarks().end_id()};
  ChangeLandmark(id, landmark);
  new_landmarks_.Add(id);
  return id;
}

void MapEditor::ChangeLandmark(LandmarkId id, const Landmark& landmark) {
  Check(map_.ChangeLandmark({id, landmark}));
  changed_landmarks_.Add(id);
  touched_.Add(id);
}

void MapEditor::RemoveLandmark(LandmarkId id) {
  while (!map_.ObservationsOf(id).empty()) RemoveObservation(id, map_.ObservationsOf(id).back());
  Check(map_.RemoveLandmark(id));
  changed_landmarks_.Remove(id);
  touched_.Remove(id);
  if (!new_landmarks_.Remove(id)) {
    removed_landmarks_.Add(id);
  }
}

void MapEditor::MergeLandmarks(LandmarkId removed, LandmarkId kept) {
  const auto observations = map_.landmarks().Find(removed)->observations;
  RemoveLandmark(removed);
  for (const Observation& observation : observations) {
    if (!map_.IsSeenBy(kept, observation.keyframe)) {
      AddObservation(kept, observation);
    }
  }
}

void MapEditor::AddObservation(LandmarkId landmark, const Observation& observation) {
  const MapDelta::ChangedObservation fact{landmark, observation};
  EditObservation({fact, 1}, map_.AddObservation(fact));
}

void MapEditor::RemoveObservation(LandmarkId landmark, const Observation& observation) {
  const MapDelta::ChangedObservation fact{landmark, observation};
  EditObservation({fact, -1}, map_.RemoveObservation(fact));
}

void MapEditor::EditObservation(const ObservationEdit& edit, const Result<>& applied) {
  Check(applied);
  observations_.push_back(edit);
  touched_.Add(edit.fact.landmark);
  reobserved_.Add(edit.fact.landmark);
}

void MapEditor::AddClosedLoop(const ClosedLoop& loop) {
  map_.AddClosedLoop(loop);
  closed_loops_.push_back(loop);
}

void MapEditor::ChangeLens(const LensCorrection& lens) {
  if (!new_keyframes_.empty()) throw std::logic_error("map editor: the lens changes before keyframes are added");
  map_.ChangeLens(lens);
  lens_ = lens;
}

MapDelta MapEditor::Finish(KeyframeId answers) {
  MapDelta delta;
  delta.number = number_;
  delta.lens = lens_;
  delta.closed_loops = closed_loops_;
  delta.answers = answers;
  for (const auto& [id, added] : new_keyframes_) {
    delta.new_keyframes.push_back(added);
  }
  changed_poses_.ForEach([&](KeyframeId id) {
    const Keyframe& keyframe = *map_.FindKeyframe(id);
    delta.moved_keyframes.push_back({id, keyframe.world_from_camera, keyframe.scale});
  });
  const std::vector<LandmarkId> changed_landmarks = changed_landmarks_.Ids();
  delta.changed_landmarks.reserve(changed_landmarks.size());
  for (const LandmarkId id : changed_landmarks) {
    delta.changed_landmarks.push_back({id, *map_.FindLandmark(id)});
  }
  ListObservations(delta);
  changed_parents_.ForEach(
      [&](KeyframeId id) { delta.changed_parents.push_back({id, map_.FindKeyframe(id)->parent}); });
  delta.removed_landmarks = removed_landmarks_.Ids();
  delta.removed_keyframes = removed_keyframes_.Ids();
  delta.hash = map_.hash();
  map_.next_delta_ = number_ + 1;
  map_.answered_ = answers;
  return delta;
}

// Each fact that is true now and was not before, or the other way round, by landmark and keyframe.
void MapEditor::ListObservations(MapDelta& delta) {
  std::sort(observations_.begin(), observations_.end(),
            [](const ObservationEdit& a, const ObservationEdit& b) { return a.fact < b.fact; });
  for (auto edit = observations_.begin(); edit != observations_.end();) {
    const MapDelta::ChangedObservation fact = edit->fact;
    int change = 0;
    for (; edit != observations_.end() && edit->fact == fact; ++edit) change += edit->change;
    if (change != 0) (change > 0 ? delta.new_observations : delta.removed_observations).push_back(fact);
  }
}

}  // namespace tessera
