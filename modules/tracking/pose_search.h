// The pose of a frame from the landmarks of the map: with a rough idea of it, or with none.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/absolute_pose.h"
#include "geometry/pose_optimization.h"
#include "tracking/association.h"
#include "tracking/odometry_map.h"

namespace tessera {

struct PoseSearchOptions {
  double predicted_radius_px = 15.0;  // window around a place that was predicted, times the scale of the level
  double refined_radius_px = 4.0;     // the same once the pose is known
  MatchingOptions matching{70, 0.9, true};
  PoseOptimizationOptions pose;
  int min_inliers = 20;  // landmarks that must agree on a pose
  MatchingOptions relocalization_matching{60, 0.8, true};
  AbsolutePoseOptions absolute_pose;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

struct FoundPose {
  Rigid3 camera_from_world;
  std::vector<Match> inliers;     // first: index of the landmark; second: keypoint
  std::vector<char> is_expected;  // by landmark: it should be seen
  int num_matches = 0;            // inliers and outliers
};

// Looks for the landmarks around where `guess` puts them, and optimises the pose on what is found. nullopt if fewer
// than min_inliers agree.
std::optional<FoundPose> SearchPose(const FrameView& frame, std::span<const LocalLandmark> landmarks,
                                    const Rigid3& guess, double radius_px, const PoseSearchOptions& options);

// Matches the keyframe's landmarks by descriptor alone, and takes the pose that most of them agree on. nullopt if those
// are too few. `seed` decides the random samples.
std::optional<Rigid3> PoseFromKeyframe(const FrameView& frame, const OdometryMap& map, KeyframeId keyframe,
                                       uint64_t seed, const PoseSearchOptions& options);

}  // namespace tessera
