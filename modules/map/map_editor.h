// The owner's way to change its map: each edit is applied at once, and all of them together become one delta with
// nothing in it that a later edit took back.
//
// Every edit goes through the functions that apply deltas, so the owner's map changes in the way of all replicas.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "core/id_set.h"
#include "map/map.h"

namespace tessera {

class MapEditor {
 public:
  // `map` must outlive the editor and be changed by nobody else meanwhile.
  explicit MapEditor(Map& map) : map_(map), number_(map.next_delta()) {}

  const Map& map() const { return map_; }

  void AddKeyframe(KeyframeId id, KeyframeId parent, const Sim3& world_from_keyframe,
                   std::shared_ptr<const FeatureFrame> features);
  // Its scale stays.
  void MoveKeyframe(KeyframeId id, const Rigid3& world_from_camera);
  void MoveKeyframe(KeyframeId id, const Sim3& world_from_keyframe);
  void SetParent(KeyframeId id, KeyframeId parent);
  // Its observations go with it. Its children must have another parent by the time of Finish().
  void RemoveKeyframe(KeyframeId id);

  // A landmark that did not exist before, with the next free id.
  LandmarkId AddLandmark(const Landmark& landmark);
  void ChangeLandmark(LandmarkId id, const Landmark& landmark);
  // Its observations go with it.
  void RemoveLandmark(LandmarkId id);
  // `kept` gets the observations of `removed`, but for keyframes and keypoints where it has one already.
  void MergeLandmarks(LandmarkId removed, LandmarkId kept);

  // The keyframe must not see the landmark yet, nor the keypoint another one.
  void AddObservation(LandmarkId landmark, const Observation& observation);
  void RemoveObservation(LandmarkId landmark, const Observation& observation);

  void AddClosedLoop(const ClosedLoop& loop);

  // Before any keyframe is added.
  void ChangeLens(const LensCorrection& lens);

  // Landmarks whose position or observations changed and that still exist, by id: what derives from them is stale.
  const IdSet<LandmarkId>& touched_landmarks() const { return touched_; }
  // Landmarks of which an observation came or went, also such as no longer exist.
  const IdSet<LandmarkId>& reobserved_landmarks() const { return reobserved_; }

  // The delta of all edits. The editor must not be used after it.
  MapDelta Finish(KeyframeId answers);

 private:
  struct ObservationEdit {
    MapDelta::ChangedObservation fact;
    int change = 0;  // 1: new, -1: removed
  };
  void EditObservation(const ObservationEdit& edit, const Result<>& applied);
  void ListObservations(MapDelta& delta);

  Map& map_;
  const int64_t number_;
  std::map<KeyframeId, MapDelta::NewKeyframe> new_keyframes_;
  IdSet<KeyframeId> changed_poses_, changed_parents_, removed_keyframes_;
  IdSet<LandmarkId> new_landmarks_, changed_landmarks_, removed_landmarks_, touched_, reobserved_;
  std::vector<ClosedLoop> closed_loops_;
  LensCorrection lens_;
  std::vector<ObservationEdit> observations_;  // in the order of the edits
};

}  // namespace tessera
