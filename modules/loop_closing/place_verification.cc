#include "loop_closing/place_verification.h"

#include <algorithm>
#include <map>
#include <memory>

#include "map/neighborhood.h"
#include "matching/frame_pose.h"

namespace tessera {
namespace {

// A keypoint of the matched keyframe (first) and one of the current (second), whose landmarks should be the same point.
PointPair MakePair(const Map& map, const Keyframe& matched, const Keyframe& current, const KeypointPair& pair) {
  const auto seen = [&](const Keyframe& keyframe, int32_t keypoint, Eigen::Vector3d* point, PixelObservation* pixel) {
    const Landmark& landmark = *map.FindLandmark(keyframe.landmarks[Index(keypoint)]);
    *point = keyframe.world_from_camera.Inverse() * landmark.position_in_world;
    *pixel = SeenAt(*keyframe.features, keypoint);
  };
  PointPair points;
  seen(matched, pair.first, &points.point_in_first, &points.seen_first);
  seen(current, pair.second, &points.point_in_second, &points.seen_second);
  return points;
}

std::vector<KeypointPair> MatchLandmarks(const PlaceDatabase& places, KeyframeId matched_id, const Keyframe& matched,
                                         KeyframeId current_id, const Keyframe& current,
                                         const BagMatchingOptions& options) {
  const BagOfWords* matched_bag = places.Find(matched_id);
  const BagOfWords* current_bag = places.Find(current_id);
  if (matched_bag == nullptr || current_bag == nullptr) return {};
  const auto sees = [](const Keyframe& keyframe) {
    return [&keyframe](int32_t keypoint) { return keyframe.landmarks[Index(keypoint)].valid(); };
  };
  return MatchByBags(*matched.features, *matched_bag, sees(matched), *current.features, *current_bag, sees(current),
                     options);
}

// Points that guided matching found in the current keyframe, where that has a landmark of its own for them and the
// matched keyframe observes them too.
std::vector<PointPair> DuplicatePairs(const Map& map, const TrackedFrame& frame, const Keyframe& matched,
                                      const Keyframe& current) {
  std::map<LandmarkId, int32_t> keypoint_of;
  for (size_t i = 0; i < matched.landmarks.size(); ++i) {
    if (matched.landmarks[i].valid()) keypoint_of[matched.landmarks[i]] = static_cast<int32_t>(i);
  }
  std::vector<PointPair> pairs;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid() || !current.landmarks[i].valid()) continue;
    const auto found = keypoint_of.find(frame.points[i].id.landmark);
    if (found == keypoint_of.end()) continue;
    pairs.push_back(MakePair(map, matched, current, {found->second, static_cast<int32_t>(i)}));
  }
  return pairs;
}

SimilarityOptions SimilarityFor(const CameraCalibration& camera, SimilarityOptions options) {
  options.has_scale = camera.sensor == SensorType::kMono;
  options.baseline_m = options.has_scale ? 0.0 : Baseline(camera);
  return options;
}

}  // namespace

Result<> VerificationOptions::Check() const {
  if (min_matches < 3 || min_seen < 6 || num_neighbors < 1) {
    return Failed("verification needs at least 3 matches and 6 observed landmarks");
  }
  if (!(min_coverage >= 0.0 && min_coverage <= 1.0)) return Failed("min_coverage must be between 0 and 1");
  TESSERA_RETURN_IF_FAILED(similarity.Check());
  return guided.Check();
}

KnownPoints LandmarksAround(const Map& map, KeyframeId center, int num_neighbors) {
  KnownPoints points;
  for (const LandmarkId id : LandmarksSeenBy(map, KeyframesAround(map, center, num_neighbors))) {
    points.emplace_back(PointId{id, {}, -1}, *map.FindLandmark(id));
  }
  return points;
}

int LocalizeAmong(const KnownPoints& points, const MatchOptions& matching, const PoseOptimizationOptions& pose,
                  TrackedFrame& frame) {
  frame.points.assign(frame.points.size(), {});
  MatchLocal(points, matching.local_radius_px, matching, frame);
  return OptimizeFrame(pose, frame);
}

std::optional<VerifiedPlace> VerifyPlace(const Map& map, const PlaceDatabase& places, KeyframeId current_id,
                                         KeyframeId candidate, const VerificationOptions& options,
                                         VerificationSteps* steps) {
  const Keyframe& current = *map.FindKeyframe(current_id);
  const Keyframe& matched = *map.FindKeyframe(candidate);
  const CameraCalibration& camera = current.features->calibration;
  const SimilarityOptions similarity = SimilarityFor(camera, options.similarity);
  const std::vector<KeypointPair> matches =
      MatchLandmarks(places, candidate, matched, current_id, current, options.matching);
  steps->is_matched = static_cast<int>(matches.size()) >= options.min_matches;
  if (!steps->is_matched) return std::nullopt;

  std::vector<PointPair> pairs;
  for (const KeypointPair& match : matches) pairs.push_back(MakePair(map, matched, current, match));
  const auto seed = static_cast<uint64_t>(current.features->frame.value);
  const std::optional<SimilarityEstimate> aligned = EstimateSimilarity(camera, pairs, seed, similarity);
  steps->is_aligned = aligned.has_value();
  if (!aligned) return std::nullopt;

  TrackedFrame frame(std::make_shared<const FrameView>(*current.features));
  const KnownPoints landmarks = LandmarksAround(map, candidate, options.num_neighbors);
  frame.world_from_camera = (Sim3::From(matched.world_from_camera) * aligned->first_from_second).Pose();
  if (LocalizeAmong(landmarks, options.guided, {}, frame) < options.min_seen) return std::nullopt;
  if (Coverage(landmarks, frame) < options.min_coverage) return std::nullopt;
  const SimilarityEstimate refined =
      RefineSimilarity(camera, DuplicatePairs(map, frame, matched, current), aligned->first_from_second, similarity);
  if (refined.num_inliers < similarity.min_inliers) return std::nullopt;

  VerifiedPlace place{.matched = candidate, .matched_from_current = {}, .seen = {}};
  place.matched_from_current =
      Sim3::From(matched.world_from_camera.Inverse() * frame.world_from_camera, refined.first_from_second.scale);
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (frame.points[i].valid()) place.seen.push_back({static_cast<int32_t>(i), frame.points[i].id.landmark});
  }
  place.seen_share = static_cast<double>(place.seen.size()) / std::max(1, NumExpected(landmarks, frame));
  return place;
}

}  // namespace tessera
