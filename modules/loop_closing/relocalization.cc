#include "loop_closing/relocalization.h"

#include <memory>
#include <optional>
#include <vector>

#include "loop_closing/place_verification.h"

namespace tessera {
namespace {

// The pose of the camera in the world from the landmarks of one keyframe.
std::optional<Rigid3> RoughPose(const Keyframe& keyframe, const BagOfWords& keyframe_bag, const Map& map,
                                const FrameView& view, const BagOfWords& bag, const RelocalizationOptions& options) {
  const FeatureFrame& features = view.features();
  const std::vector<KeypointPair> pairs = MatchByBags(
      *keyframe.features, keyframe_bag, [&](int32_t i) { return keyframe.landmarks[Index(i)].valid(); }, features, bag,
      [](int32_t) { return true; }, options.matching);
  if (static_cast<int>(pairs.size()) < options.min_matches) return std::nullopt;
  std::vector<PointPixel> points;
  for (const KeypointPair& pair : pairs) {
    const PixelObservation seen = view.observation(pair.second);
    const Landmark& landmark = *map.FindLandmark(keyframe.landmarks[Index(pair.first)]);
    points.push_back({landmark.position_in_world, seen.pixel_px, seen.sigma_px});
  }
  const auto seed = static_cast<uint64_t>(features.frame.value);
  const std::optional<AbsolutePose> pose = EstimateAbsolutePose(features.calibration, points, seed, options.pose);
  if (!pose) return std::nullopt;
  return pose->camera_from_world.Inverse();
}

}  // namespace

Result<> RelocalizationOptions::Check() const {
  if (min_matches < 4 || min_seen < 6 || num_neighbors < 1) {
    return Failed("relocalization needs at least 4 matches and 6 observed landmarks");
  }
  if (!(min_coverage >= 0.0 && min_coverage <= 1.0)) return Failed("min_coverage must be between 0 and 1");
  if (!(min_seen_share >= 0.0 && min_seen_share <= 1.0)) return Failed("min_seen_share must be between 0 and 1");
  return guided.Check();
}

RelocalizationAnswer Relocalize(const Map& map, const PlaceDatabase& places, const Vocabulary& vocabulary,
                                const RelocalizationRequest& request, const CandidateOptions& candidates,
                                const RelocalizationOptions& options) {
  RelocalizationAnswer answer;
  answer.frame = request.features.frame;
  const auto view = std::make_shared<const FrameView>(WithLens(request.features, map.lens()));
  const BagOfWords bag = vocabulary.Describe(view->features().descriptors);
  const std::vector<KeyframeId> found = FindPlaces(map, places, bag, candidates);
  answer.num_candidates = static_cast<int32_t>(found.size());
  for (const KeyframeId id : found) {
    const Keyframe& keyframe = *map.FindKeyframe(id);
    const std::optional<Rigid3> pose = RoughPose(keyframe, *places.Find(id), map, *view, bag, options);
    if (!pose) continue;
    TrackedFrame frame(view);
    frame.world_from_camera = *pose;
    const KnownPoints landmarks = LandmarksAround(map, id, options.num_neighbors);
    const int num_seen = LocalizeAmong(landmarks, options.guided, {}, frame);
    if (num_seen < options.min_seen || num_seen < options.min_seen_share * NumExpected(landmarks, frame)) continue;
    if (Coverage(landmarks, frame) < options.min_coverage) continue;
    answer.reference = id;
    answer.reference_from_camera = (keyframe.WorldFromKeyframe().Inverse() * frame.world_from_camera).Pose();
    for (size_t i = 0; i < frame.points.size(); ++i) {
      if (frame.points[i].valid()) answer.seen.push_back({static_cast<int32_t>(i), frame.points[i].id.landmark});
    }
    break;
  }
  return answer;
}

}  // namespace tessera
