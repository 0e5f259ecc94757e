#include "mapping/landmark_creation.h"

#include <algorithm>

#include "measurement/landmark_description.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

LandmarkId AddLandmark(const Eigen::Vector3d& position_in_world, std::initializer_list<Observation> observations,
                       MapEditor& editor) {
  const LandmarkId id = editor.AddLandmark({.position_in_world = position_in_world});
  for (const Observation& observation : observations) {
    editor.AddObservation(id, observation);
  }
  editor.ChangeLandmark(id, DescribeLandmark(editor.map(), id));
  return id;
}

// The keyframe's keypoints that see no landmark yet, each with its match in the other keyframe.
void CreateFromPair(KeyframeId id, KeyframeId other_id, const EpipolarSearch& search, std::vector<LandmarkId>& created,
                    MapEditor& editor) {
  const Keyframe& keyframe = *editor.map().FindKeyframe(id);
  const Keyframe& other = *editor.map().FindKeyframe(other_id);
  for (int32_t i = 0; i < static_cast<int32_t>(keyframe.landmarks.size()); ++i) {
    if (keyframe.landmarks[Index(i)].valid()) continue;
    const auto match = search.Find(i);
    if (!match || other.landmarks[Index(match->keypoint)].valid()) continue;
    const Eigen::Vector3d position = keyframe.world_from_camera * match->point_in_first;
    created.push_back(AddLandmark(position, {{id, i}, {other_id, match->keypoint}}, editor));
  }
}

}  // namespace

Result<> CreationOptions::Check() const {
  if (max_neighbors < 1) return Failed("new landmarks need at least one neighbor to be searched");
  if (!(min_baseline_share > 0.0)) return Failed("the least baseline of new landmarks must be positive");
  TESSERA_RETURN_IF_FAILED(depth.Check());
  return matching.Check();
}

std::vector<LandmarkId> CreateFromDepth(KeyframeId id, const CreationOptions& options, MapEditor& editor) {
  const Keyframe& keyframe = *editor.map().FindKeyframe(id);
  const auto sees_known = [&keyframe](int32_t i) { return keyframe.landmarks[Index(i)].valid(); };
  std::vector<LandmarkId> created;
  for (const auto& [keypoint, point_in_camera] : NewDepthPoints(*keyframe.features, sees_known, options.depth)) {
    created.push_back(AddLandmark(keyframe.world_from_camera * point_in_camera, {{id, keypoint}}, editor));
  }
  return created;
}

std::vector<LandmarkId> CreateFromPairs(KeyframeId id, const CreationOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const std::vector<double> depths = LandmarkDepths(map, keyframe);
  std::vector<LandmarkId> created;
  if (depths.empty()) return created;
  const double min_depth = depths[depths.size() / 20] / 3.0, median_depth = depths[depths.size() / 2];
  const double camera_baseline_m = Baseline(keyframe.features->calibration);
  const double min_baseline = camera_baseline_m > 0.0 ? camera_baseline_m : options.min_baseline_share * median_depth;

  for (const KeyframeId other_id : map.Covisible(id, options.max_neighbors)) {
    const Keyframe& other = *map.FindKeyframe(other_id);
    const double baseline = (other.world_from_camera.translation - keyframe.world_from_camera.translation).norm();
    if (baseline < min_baseline) continue;
    const Rigid3 other_from_keyframe = other.world_from_camera.Inverse() * keyframe.world_from_camera;
    const auto is_free = [&other](int32_t keypoint) { return !other.landmarks[Index(keypoint)].valid(); };
    const EpipolarSearch search(*keyframe.features, *other.features, other_from_keyframe, is_free, min_depth,
                                options.matching);
    CreateFromPair(id, other_id, search, created, editor);
  }
  return created;
}

}  // namespace tessera
