// The pose of a frame by what it sees, and by how the camera moved a moment ago.
#pragma once

#include "geometry/body_state.h"
#include "geometry/pose_optimization.h"
#include "matching/point_matching.h"
#include "tracking/map_replica.h"
#include "tracking/motion_model.h"

namespace tessera {

// Where the motion of a moment ago takes the camera.
struct ExpectedStep {
  MotionPrediction motion;  // in units of the reference keyframe
  Rigid3 reference_from_last;
  Sim3 world_from_reference;

  Rigid3 WorldFromCamera() const;
  PosePrior Prior() const;
  // The motion (last_from_current) of a camera that is here, and the covariance of its translation by this information
  // about its pose.
  Rigid3 MotionTo(const Rigid3& world_from_camera) const;
  Eigen::Matrix3d CovarianceBy(const Matrix6d& information) const;
};

struct StepPose {
  PoseOptimizationResult optimized;
  int num_confirmed_matches = 0;  // of the points that the frame saw
  int num_confirmed = 0;          // of these, with which the pose agrees
  StepEvidence evidence = StepEvidence::kStrong;
  bool is_doubtful = false;  // it contradicts the motion, and may be wrong by much
};

// By the images alone where they fix how far the camera went, else carried by the motion, if one is expected (nullptr:
// none). The frame takes the pose and loses the outliers, as in OptimizeByConfirmed().
//
// Which points are outliers is told with the motion: wrong matches that agree on another one can't win. Unless most
// points contradict the motion: the camera may have been carried away. That is told, not overruled.
StepPose OptimizeStep(const MapReplica& replica, const PoseOptimizationOptions& options, const ExpectedStep* expected,
                      TrackedFrame& frame);

}  // namespace tessera
