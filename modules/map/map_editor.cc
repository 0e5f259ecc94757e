#include "map/map_editor.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace tessera {

// An edit needs no number and no hash of its own: the delta of all edits gets them.
void MapEditor::Apply(MapDelta&& edit) { ThrowIfFailed<std::logic_error>(map_.ApplyLists(edit), "map editor: "); }

void MapEditor::AddKeyframe(KeyframeId id, KeyframeId parent, const Sim3& world_from_keyframe,
                            std::shared_ptr<const FeatureFrame> features) {
  const MapDelta::NewKeyframe added{id, parent, world_from_keyframe.Pose(), std::move(features),
                                    world_from_keyframe.scale};
  Apply({.new_keyframes = {added}});
  new_keyframes_[id] = added;
}

void MapEditor::MoveKeyframe(KeyframeId id, const Rigid3& world_from_camera) {
  MoveKeyframe(id, Sim3::From(world_from_camera, map_.FindKeyframe(id)->scale));
}

void MapEditor::MoveKeyframe(KeyframeId id, const Sim3& world_from_keyframe) {
  Apply({.moved_keyframes = {{id, world_from_keyframe.Pose(), world_from_keyframe.scale}}});
  changed_poses_.insert(id);
}

void MapEditor::SetParent(KeyframeId id, KeyframeId parent) {
  Apply({.changed_parents = {{id, parent}}});
  changed_parents_.insert(id);
}

void MapEditor::RemoveKeyframe(KeyframeId id) {
  const std::vector<LandmarkId> landmarks = map_.FindKeyframe(id)->landmarks;
  for (size_t i = 0; i < landmarks.size(); ++i) {
    if (landmarks[i].valid()) {
      RemoveObservation(landmarks[i], {id, static_cast<int32_t>(i)});
    }
  }
  Apply({.removed_keyframes = {id}});
  changed_poses_.erase(id);
  changed_parents_.erase(id);
  if (new_keyframes_.erase(id) == 0) {
    removed_keyframes_.insert(id);
  }
}

LandmarkId MapEditor::AddLandmark(const Landmark& landmark) {
  const LandmarkId id{map_.landmarks().end_id()};
  Apply({.changed_landmarks = {{id, landmark}}});
  new_landmarks_.insert(id);
  changed_landmarks_.insert(id);
  touched_.insert(id);
  return id;
}

void MapEditor::ChangeLandmark(LandmarkId id, const Landmark& landmark) {
  Apply({.changed_landmarks = {{id, landmark}}});
  changed_landmarks_.insert(id);
  touched_.insert(id);
}

void MapEditor::RemoveLandmark(LandmarkId id) {
  const std::vector<Observation> observations = map_.ObservationsOf(id);
  for (const Observation& observation : observations) {
    RemoveObservation(id, observation);
  }
  Apply({.removed_landmarks = {id}});
  changed_landmarks_.erase(id);
  touched_.erase(id);
  if (new_landmarks_.erase(id) == 0) {
    removed_landmarks_.insert(id);
  }
}

void MapEditor::MergeLandmarks(LandmarkId removed, LandmarkId kept) {
  const std::vector<Observation> observations = map_.ObservationsOf(removed);
  RemoveLandmark(removed);
  for (const Observation& observation : observations) {
    if (!map_.IsSeenBy(kept, observation.keyframe)) {
      AddObservation(kept, observation);
    }
  }
}

void MapEditor::AddObservation(LandmarkId landmark, const Observation& observation) {
  Apply({.new_observations = {{landmark, observation}}});
  ++observations_[{landmark, observation}];
  touched_.insert(landmark);
  reobserved_.insert(landmark);
}

void MapEditor::RemoveObservation(LandmarkId landmark, const Observation& observation) {
  Apply({.removed_observations = {{landmark, observation}}});
  --observations_[{landmark, observation}];
  touched_.insert(landmark);
  reobserved_.insert(landmark);
}

void MapEditor::AddClosedLoop(const ClosedLoop& loop) {
  Apply({.closed_loops = {loop}});
  closed_loops_.push_back(loop);
}

MapDelta MapEditor::Finish(KeyframeId answers) {
  MapDelta delta;
  delta.number = number_;
  delta.closed_loops = closed_loops_;
  delta.answers = answers;
  for (const auto& [id, added] : new_keyframes_) {
    delta.new_keyframes.push_back(added);
  }
  for (const KeyframeId id : changed_poses_) {
    const Keyframe& keyframe = *map_.FindKeyframe(id);
    delta.moved_keyframes.push_back({id, keyframe.world_from_camera, keyframe.scale});
  }
  for (const LandmarkId id : changed_landmarks_) {
    delta.changed_landmarks.push_back({id, *map_.FindLandmark(id)});
  }
  for (const auto& [fact, change] : observations_) {
    if (change == 0) continue;
    auto& list = change > 0 ? delta.new_observations : delta.removed_observations;
    list.push_back({fact.first, fact.second});
  }
  for (const KeyframeId id : changed_parents_) {
    delta.changed_parents.push_back({id, map_.FindKeyframe(id)->parent});
  }
  delta.removed_landmarks.assign(removed_landmarks_.begin(), removed_landmarks_.end());
  delta.removed_keyframes.assign(removed_keyframes_.begin(), removed_keyframes_.end());
  delta.hash = map_.hash();
  map_.next_delta_ = number_ + 1;
  map_.answered_ = answers;
  return delta;
}

}  // namespace tessera
