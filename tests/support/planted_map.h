// Maps of a SyntheticWorld that are put together by hand: what every keypoint shows is known, and so is the drift of
// each keyframe.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "map/landmark_description.h"
#include "map/map_editor.h"
#include "support/synthetic_world.h"

namespace tessera {

class PlantedMap {
 public:
  explicit PlantedMap(SyntheticWorld& world) : world_(world) {}

  // The next keyframe takes a picture at a step of the world. The map holds it, and the points that no keyframe of this
  // visit has seen yet, where `map_from_truth` puts them: two visits know the same points under different names.
  // `change`: done to the picture first.
  KeyframeId Add(
      int64_t step, KeyframeId parent, int visit = 0, const Sim3& map_from_truth = {},
      const std::function<void(FeatureFrame&)>& change = [](FeatureFrame&) {}) {
    const KeyframeId id{map_.keyframes().end_id()};
    SyntheticWorld::Picture picture = world_.Take(step);
    picture.features.frame = {id.value};
    change(picture.features);
    MapEditor editor(map_);
    const Rigid3 pose = world_.Pose(static_cast<double>(step));
    // The keyframe's units are those of the map where it stands.
    editor.AddKeyframe(id, parent, Sim3::From((map_from_truth * Sim3::From(pose)).Pose()),
                       std::make_shared<const FeatureFrame>(picture.features));
    std::vector<LandmarkId> seen;
    for (size_t i = 0; i < picture.points.size(); ++i) {
      auto [known, is_new] = landmarks_.try_emplace({visit, picture.points[i]});
      if (is_new)
        known->second = editor.AddLandmark({.position_in_world = map_from_truth * world_.point(picture.points[i])});
      editor.AddObservation(known->second, {id, static_cast<int32_t>(i)});
      seen.push_back(known->second);
    }
    for (const LandmarkId landmark : seen) editor.ChangeLandmark(landmark, DescribeLandmark(map_, landmark));
    deltas_.push_back(editor.Finish(id));
    points_.push_back(picture.points);
    poses_.push_back(pose);
    return id;
  }

  Map& map() { return map_; }
  const Map& map() const { return map_; }
  // That made the map, one a keyframe.
  const std::vector<MapDelta>& deltas() const { return deltas_; }
  size_t PointOf(const Observation& seen) const {
    return points_[static_cast<size_t>(seen.keyframe.value)][static_cast<size_t>(seen.keypoint)];
  }
  const Rigid3& Truth(KeyframeId id) const { return poses_[static_cast<size_t>(id.value)]; }
  // matched_from_current as it is in truth.
  Rigid3 Between(KeyframeId matched, KeyframeId current) const { return Truth(matched).Inverse() * Truth(current); }

  // Landmarks of which keyframes see different points.
  int NumMixed(const Map& map) const {
    int num_mixed = 0;
    map.landmarks().ForEach([&](LandmarkId id, const Landmark&) {
      const std::vector<Observation>& seen = map.ObservationsOf(id);
      num_mixed += std::any_of(seen.begin(), seen.end(),
                               [&](const Observation& o) { return PointOf(o) != PointOf(seen.front()); });
    });
    return num_mixed;
  }
  // The greatest distance of a keyframe from the truth, once `map_from_truth` is taken off.
  double WorstKeyframe(const Map& map, const Sim3& map_from_truth = {}) const {
    double worst = 0.0;
    map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
      worst = std::max(worst, (keyframe.world_from_camera.translation - map_from_truth * Truth(id).translation).norm());
    });
    return worst;
  }
  // Median distance of landmarks from the truth.
  double MedianLandmark(const Map& map, const Sim3& map_from_truth = {}) const {
    std::vector<double> errors;
    map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
      const size_t point = PointOf(map.ObservationsOf(id).front());
      errors.push_back((landmark.position_in_world - map_from_truth * world_.point(point)).norm());
    });
    std::sort(errors.begin(), errors.end());
    return errors[errors.size() / 2];
  }

 private:
  SyntheticWorld& world_;
  Map map_;
  std::map<std::pair<int, size_t>, LandmarkId> landmarks_;  // by visit and point
  std::vector<std::vector<size_t>> points_;                 // by keyframe and keypoint
  std::vector<Rigid3> poses_;
  std::vector<MapDelta> deltas_;
};

}  // namespace tessera
