// The pose of a camera that sees known points.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"

namespace tessera {

// A known point and where the camera sees it.
struct PoseObservation {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  PixelObservation seen;
};

struct PoseOptimizationOptions {
  int num_rounds = 4;      // after each, observations are sorted anew into inliers and outliers
  int max_iterations = 5;  // Gauss-Newton steps a round; they converge in 2 to 4 from a fair start
  double min_step = 1e-9;  // a smaller step (meters and radians, norm) ends the round
};

struct PoseOptimizationResult {
  Rigid3 camera_from_world;
  std::vector<char> is_inlier;  // by observation: 1 if it agrees with the pose (chi-square, 95 %)
  int num_inliers = 0;
  double rms = 0.0;  // of the inliers' whitened residuals; about 1 where sigma_px is true
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();  // of Retract's tangent
};

// Minimizes over camera_from_world, by Gauss-Newton with Huber weights,
//
//   sum_i rho(|r_i|^2),   r_i = (project(camera_from_world * point_i) - pixel_i) / sigma_i
//
// The points are taken as exact. Observations that stand behind the camera, or that fail the chi-square test after a
// round, take no part in the next; they may return. `baseline_m` as in Reprojection. With fewer than 3 inliers the pose
// is returned as it was and num_inliers is 0.
PoseOptimizationResult OptimizePose(const CameraCalibration& calibration, double baseline_m,
                                    std::span<const PoseObservation> observations, const Rigid3& camera_from_world,
                                    const PoseOptimizationOptions& options);

}  // namespace tessera
