// What tracking tells the rest: the pose of each frame (POSE) and the frames worth keeping (KEYFRAME).
#pragma once

#include <cstdint>
#include <vector>

#include "core/ids.h"
#include "features/feature_types.h"
#include "geometry/body_state.h"
#include "geometry/rigid3.h"

namespace tessera {

enum class TrackingState {
  kInitializing = 0,  // no map yet: the frame has no pose
  kTracked = 1,       // the pose is estimated
  kLost = 2,          // there was a map, but this frame could not be placed in it: no pose
};

// The pose of one frame as it was known at the time. Every frame that reaches the tracker gets one.
struct PoseEstimate {
  FrameId frame;
  int64_t utime_us = 0;     // when the image was taken
  int64_t captured_us = 0;  // see FeatureFrame
  int64_t latency_us = 0;   // from then until the pose left the tracker; for measuring only
  TrackingState state = TrackingState::kInitializing;
  Rigid3 world_from_camera;       // valid if tracked. Mono: units of the map
  KeyframeId reference_keyframe;  // the keyframe that the pose is stored relative to
  Rigid3 reference_from_camera;   // pose in its units: what is left true when it moves (Keyframe::scale)
  KeyframeId map_part;            // the root of its part of the map (map/spanning_tree.h); invalid unless tracked
  int32_t num_features = 0;       // keypoints of the frame
  int32_t num_matches = 0;        // matched to landmarks
  int32_t num_inliers = 0;        // of those, consistent with the pose
  int32_t num_landmarks = 0;      // landmarks in the map
  bool is_keyframe = false;
  bool is_relocalized = false;  // the first pose after a loss, in a part of the map that was there before
  // The images contradict the motion of a moment ago: the scale may have slipped, or the camera was carried away.
  bool is_step_doubtful = false;
  // Mono: by how much the scale may have changed in the last seconds (tracking/scale_watch.h), a standard deviation of
  // its logarithm; or by how much the ground says that it has fallen (tracking/ground_watch.h), if that is more. 0
  // where depth is measured.
  double scale_sigma = 0.0;
  FrameId relocalized_by;         // the frame whose RELOCALIZATION this one was placed by; invalid: none was used
  int64_t num_deltas = 0;         // deltas that the map had seen by then: its step
  bool is_live = false;           // the step is what happened to be there, not what logical time asks for
  int64_t map_wait_us = 0;        // how long the frame had to wait for its step; for measuring only
  BodyState body;                 // valid if tracked; of the camera itself where no base is known
  double coverage = 0.0;          // share of the image's cells (kCoverageColumns x kCoverageRows) that hold an inlier
  int64_t since_tracked_us = -1;  // from the last frame with a pose to this one, 0 if it has one itself; -1: none had
};

inline constexpr int kCoverageColumns = 8, kCoverageRows = 6;

// A keypoint that sees what a keypoint of an earlier keyframe saw, said before the tracker knows the landmark's id.
struct SharedKeypoint {
  int32_t keypoint = -1;        // of the new keyframe
  KeyframeId other;             // an earlier keyframe
  int32_t other_keypoint = -1;  // of `other`
  // Where the tracker takes the point to be, in the camera frame and the units of `other` (Keyframe::scale).
  Eigen::Vector3d position_in_other = Eigen::Vector3d::Zero();
};

// Where a camera should be by how it moved a moment ago, whatever its images say (tracking/motion_model.h).
struct MotionPrior {
  Eigen::Vector3d position_in_reference = Eigen::Vector3d::Zero();  // frame and units of the reference keyframe
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();            // of it, 1 / units^2; zero: nothing is expected

  bool is_known() const { return !information.isZero(0.0); }
};

// Mono: from this keyframe on, up to the next one that is named, lengths in the map are to be multiplied by
// exp(log_factor).
struct ScaleMending {
  KeyframeId keyframe;
  double log_factor = 0.0;
  bool operator==(const ScaleMending&) const = default;
};

// A frame that becomes part of the map. Its features never change; its pose does, later, in the mapper.
struct KeyframeObservation {
  KeyframeId id;
  FeatureFrame features;
  Rigid3 world_from_camera;            // the tracker's estimate
  std::vector<LandmarkId> landmarks;   // by keypoint: the landmark it saw; invalid: none
  KeyframeId reference;                // the keyframe that the estimate is relative to; invalid: a new part begins
  Rigid3 reference_from_camera;        // as in PoseEstimate
  MotionPrior expected;                // by how the camera moved when `reference` was made; where images leave it open
  std::vector<SharedKeypoint> shared;  // points without an id yet: mono's first ones, or from depth
  std::vector<ScaleMending> mendings;  // by keyframe, earlier ones of its part; empty: its scale has not slipped
  std::vector<LandmarkId> not_scene;   // by id: that turned out to move with the camera (tracking/own_body.h)
  int64_t num_deltas = 0;              // as in PoseEstimate
};

}  // namespace tessera
