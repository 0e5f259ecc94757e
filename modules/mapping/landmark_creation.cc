#include "mapping/landmark_creation.h"

#include <algorithm>

#include "measurement/landmark_description.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

constexpr double kMinBaselineShare = 1e-4;  // of the least depth: nearer views are the same one

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

// Keyframes that share landmarks with this one, most of them first.
struct Neighbors {
  std::vector<KeyframeId> telling;  // far enough away to tell depths
  std::vector<KeyframeId> near;     // mono: the others
};

Neighbors FindNeighbors(const Map& map, KeyframeId id, double min_depth, double median_depth,
                        const CreationOptions& options) {
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const double camera_baseline_m = Baseline(keyframe.features->calibration);
  const double telling = camera_baseline_m > 0.0 ? camera_baseline_m : options.min_baseline_share * median_depth;
  Neighbors neighbors;
  for (const KeyframeId other_id : map.Covisible(id, options.max_neighbors)) {
    const Keyframe& other = *map.FindKeyframe(other_id);
    const double baseline = (other.world_from_camera.translation - keyframe.world_from_camera.translation).norm();
    if (baseline >= telling) {
      neighbors.telling.push_back(other_id);
    } else if (camera_baseline_m == 0.0 && baseline > kMinBaselineShare * min_depth) {
      neighbors.near.push_back(other_id);
    }
  }
  return neighbors;
}

int NumLandmarks(const Keyframe& keyframe) {
  return static_cast<int>(std::ranges::count_if(keyframe.landmarks, &LandmarkId::valid));
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
  const auto search_in = [&](KeyframeId other_id) {
    const Keyframe& other = *map.FindKeyframe(other_id);
    const Rigid3 other_from_keyframe = other.world_from_camera.Inverse() * keyframe.world_from_camera;
    const auto is_free = [&other](int32_t keypoint) { return !other.landmarks[Index(keypoint)].valid(); };
    const EpipolarSearch search(*keyframe.features, *other.features, other_from_keyframe, is_free, min_depth,
                                options.matching);
    CreateFromPair(id, other_id, search, created, editor);
  };
  const Neighbors neighbors = FindNeighbors(map, id, min_depth, median_depth, options);
  std::ranges::for_each(neighbors.telling, search_in);
  if (NumLandmarks(keyframe) < options.few_landmarks) std::ranges::for_each(neighbors.near, search_in);
  return created;
}

}  // namespace tessera
