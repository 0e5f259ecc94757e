#include "mapping/landmark_fusion.h"

#include <algorithm>
#include <set>
#include <vector>

#include "map/neighborhood.h"
#include "measurement/feature_grid.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

// The keyframe's keypoint that matches the landmark best; -1: none does.
int32_t BestKeypoint(const Keyframe& keyframe, const FeatureGrid& grid, const View& view, const Landmark& landmark,
                     const FusionOptions& options) {
  const std::optional<ExpectedView> expected = Expect(view, landmark);
  if (!expected) return -1;
  const double baseline_m = Baseline(view.calibration);
  const Eigen::Vector3d point_in_camera = view.rotation * landmark.position_in_world + view.translation;
  const double radius_px = options.radius_px * LevelScale(expected->level);
  int32_t best = -1;
  int best_distance = options.max_hamming + 1;
  const PatchRange range = PatchRange::Levels(expected->level - 1, expected->level);
  grid.VisitWindow(expected->pixel_px, radius_px, range, [&](const PlacedKeypoint& placed) {
    const int distance = HammingDistance(landmark.descriptor, keyframe.features->descriptors[Index(placed.index)]);
    if (distance >= best_distance) return;
    const PixelObservation seen = SeenAt(*keyframe.features, placed.index);
    const Eigen::Vector3d residual = ReprojectionResidual(view.calibration, baseline_m, point_in_camera, seen);
    if (SquaredNorm(residual) > Chi2Limit(seen.has_right())) return;
    best = placed.index;
    best_distance = distance;
  });
  return best;
}

void ProjectInto(KeyframeId target, const std::vector<LandmarkId>& landmarks, const FusionOptions& options,
                 MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(target);
  const FeatureGrid grid = MakeGrid(*keyframe.features);
  const View view(keyframe.features->calibration, keyframe.world_from_camera);
  for (const LandmarkId id : landmarks) {
    const ObservedLandmark* landmark = map.landmarks().Find(id);
    if (landmark == nullptr || landmark->IsSeenBy(target)) continue;
    const int32_t keypoint = BestKeypoint(keyframe, grid, view, *landmark, options);
    if (keypoint < 0) continue;
    const LandmarkId other = keyframe.landmarks[static_cast<size_t>(keypoint)];
    if (!other.valid()) {
      editor.AddObservation(id, {target, keypoint});
      continue;
    }
    const size_t num_own = landmark->observations.size(), num_other = map.ObservationsOf(other).size();
    const bool keeps_own = num_own > num_other || (num_own == num_other && id < other);
    editor.MergeLandmarks(keeps_own ? other : id, keeps_own ? id : other);
  }
}

// In the order of its keypoints.
std::vector<LandmarkId> ObservedLandmarks(const Keyframe& keyframe) {
  std::vector<LandmarkId> landmarks;
  for (const LandmarkId id : keyframe.landmarks) {
    if (id.valid()) landmarks.push_back(id);
  }
  return landmarks;
}

}  // namespace

void ProjectLandmarks(const std::set<KeyframeId>& targets, const std::vector<LandmarkId>& landmarks,
                      const FusionOptions& options, MapEditor& editor) {
  for (const KeyframeId target : targets) ProjectInto(target, landmarks, options, editor);
}

Result<> FusionOptions::Check() const {
  if (max_neighbors < 1 || max_second_neighbors < 0)
    return Failed("landmarks must be fused with at least one neighbor");
  if (!(radius_px > 0.0) || max_hamming < 1)
    return Failed("the search for duplicate landmarks needs a positive radius and Hamming distance");
  return {};
}

void FuseLandmarks(KeyframeId id, const FusionOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  std::set<KeyframeId> targets;
  for (const KeyframeId neighbor : map.Covisible(id, options.max_neighbors)) {
    targets.insert(neighbor);
    for (const KeyframeId second : map.Covisible(neighbor, options.max_second_neighbors)) {
      targets.insert(second);
    }
  }
  targets.erase(id);

  ProjectLandmarks(targets, ObservedLandmarks(*map.FindKeyframe(id)), options, editor);
  const std::vector<KeyframeId> observers(targets.begin(), targets.end());
  ProjectInto(id, LandmarksSeenBy(map, observers), options, editor);
}

}  // namespace tessera
