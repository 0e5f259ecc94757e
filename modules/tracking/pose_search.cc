#include "tracking/pose_search.h"

namespace tessera {
std::string PoseSearchOptions::Check() const {
  if (!(predicted_radius_px > 0.0) || !(refined_radius_px > 0.0) || min_inliers < 6 ||
      pose.num_rounds < 1 || pose.max_iterations < 1 || absolute_pose.ransac_iterations < 1) {
    return "search windows and iterations must be positive, and min_inliers at least 6";
  }
  return "";
}

std::optional<FoundPose> SearchPose(const FrameView& frame, std::span<const LocalLandmark> landmarks,
                                    const Rigid3& guess, double radius_px, const PoseSearchOptions& options) {
  Associations found = AssociateByProjection(landmarks, guess, frame, {radius_px, options.matching});
  if (static_cast<int>(found.matches.size()) < options.min_inliers) {
    return std::nullopt;
  }
  std::vector<PoseObservation> observations;
  observations.reserve(found.matches.size());
  for (const Match& match : found.matches) {
    const LocalLandmark& landmark = landmarks[static_cast<size_t>(match.first)];
    observations.push_back({landmark.position_in_world, landmark.covariance, frame.observation(match.second)});
  }
  const PoseOptimizationResult optimized =
      OptimizePose(frame.calibration(), frame.baseline_m(), observations, guess, options.pose);
  if (optimized.num_inliers < options.min_inliers) {
    return std::nullopt;
  }
  FoundPose pose{optimized.camera_from_world, {}, std::move(found.is_expected), static_cast<int>(found.matches.size())};
  for (size_t i = 0; i < found.matches.size(); ++i) {
    if (optimized.is_inlier[i]) {
      pose.inliers.push_back(found.matches[i]);
    }
  }
  return pose;
}

std::optional<Rigid3> PoseFromKeyframe(const FrameView& frame, const OdometryMap& map, KeyframeId keyframe_id,
                                       uint64_t seed, const PoseSearchOptions& options) {
  const OdometryKeyframe& keyframe = map.keyframe(keyframe_id);
  std::vector<int32_t> with_landmark;
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    if (keyframe.landmarks[i].valid()) {
      with_landmark.push_back(static_cast<int32_t>(i));
    }
  }
  std::vector<PointPixel> points;
  std::vector<PoseObservation> observations;
  for (const Match& match :
       MatchEverywhere(*keyframe.view, with_landmark, frame, options.relocalization_matching)) {
    const OdometryLandmark& landmark = map.landmark(keyframe.landmarks[static_cast<size_t>(match.first)]);
    const PixelObservation seen = frame.observation(match.second);
    points.push_back({landmark.position_in_world, seen.pixel_px, seen.sigma_px});
    observations.push_back({landmark.position_in_world, landmark.covariance, seen});
  }
  const auto sampled = EstimateAbsolutePose(frame.calibration(), points, seed, options.absolute_pose);
  if (!sampled) {
    return std::nullopt;
  }
  const PoseOptimizationResult optimized = OptimizePose(frame.calibration(), frame.baseline_m(), observations,
                                                        sampled->camera_from_world, options.pose);
  return optimized.num_inliers >= options.absolute_pose.min_inliers ? std::optional(optimized.camera_from_world)
                                                                    : std::nullopt;
}

}  // namespace tessera
