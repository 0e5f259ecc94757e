// A frame that was tracked, and what is known of its pose.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "matching/point_matching.h"
#include "tracking/pose_covariance.h"

namespace tessera {

struct LocalizedFrame {
  TrackedFrame frame;
  Rigid3 reference_from_camera;  // in the reference's units (Keyframe::scale); see SentKeyframe for the first of a part
  // By the points that it sees; nullopt where nothing is known of the error, as when a part of the map begins.
  std::optional<Eigen::Matrix3d> covariance = std::nullopt;  // of the camera's center, in its axes and those units
  std::optional<PoseInfluences> influences = std::nullopt;
  std::optional<Matrix6d> way_covariance = std::nullopt;  // of the way from the reference to here
  int num_known = 0;          // points that it saw before it brought new ones, as a keyframe does
  int num_outliers = 0;       // points that were matched and contradict the pose
  bool is_wide_step = false;  // FoundFrame::is_wide
  bool is_doubtful = false;   // PoseEstimate::is_step_doubtful
};

}  // namespace tessera
