// The pose of a camera that sees known points.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"

namespace tessera {

// A point and where the camera sees it.
struct PoseObservation {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  // What isn't known of the point: its depth, along this direction (toward the cameras that saw it before), times its
  // standard deviation. Zero: the point is exact.
  Eigen::Vector3d depth_sigma_in_world = Eigen::Vector3d::Zero();
  PixelObservation seen;
  bool votes = true;  // false: it is told whether it agrees with the pose, which it doesn't change
};

// Where the camera should be by what is known without the images: its center only.
struct PosePrior {
  Rigid3 camera_from_world;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // of the center, in the camera's axes; 1 / m^2
};

// The greatest share of the information about the translation that one observation may have. Of fewer than 150
// observations, each may have three times the mean share.
inline constexpr double kMaxLeverage = 0.02;

struct PoseOptimizationOptions {
  int num_rounds = 4;             // after each, observations are sorted anew; one that changes none is the last
  int max_iterations = 5;         // Gauss-Newton steps a round; they converge in 2 to 4 from a fair start
  double min_step_sigmas = 1e-3;  // a smaller step, by what the observations know of it, ends the round
};

struct PoseOptimizationResult {
  Rigid3 camera_from_world;
  std::vector<char> is_inlier;  // by observation: 1 if it agrees with the pose (chi-square, 95 %)
  int num_inliers = 0;
  double rms = 0.0;  // of the inliers' whitened residuals; about 1 where sigma_px is true
  Eigen::Matrix<double, 6, 6> information =
      Eigen::Matrix<double, 6, 6>::Zero();  // of Retract's tangent, prior included
};

// Of the camera's center in its own axes, m^2: the part of the inverse that belongs to the translation.
Eigen::Matrix3d TranslationCovariance(const Eigen::Matrix<double, 6, 6>& information);

// Minimizes over camera_from_world and a depth u_i of each point, by Gauss-Newton with Huber weights,
//
//   sum_i rho(|r_i|^2 + u_i^2) + c' prior_information c,   r_i = (project(camera_from_world * point_i(u_i)) - pixel_i)
//   / sigma_i point_i(u) = point_i + depth_sigma_i u / (1 + u |depth_sigma_i| / d_i)     d_i: the camera's distance at
//   the start c = translation of camera_from_world * prior.camera_from_world^-1                 (without a prior 0)
//
// u counts standard deviations of the inverse depth. Each u is eliminated from the normal equations (Schur), so a far
// point whose depth hardly anything is known of holds the rotation and weighs little in the translation. Points must
// not be taken as exact where they aren't: errors in them make the motion come out too small (regression dilution, W.
// Fuller, "Measurement Error Models", 1987), and what is triangulated from that motion is nearer again.
//
// A false match whose point stands near, among far ones, would fix the translation all by itself: no Huber loss is safe
// from leverage. So no observation has more than kMaxLeverage of what all of them know of the translation (bounded
// influence, W. Krasker and R. Welsch, "Efficient Bounded-Influence Regression Estimation", JASA 1982). Observations
// that stand behind the camera, or that fail the chi-square test after a round, take no part in the next; they may
// return. `baseline_m` as in Reprojection. With fewer than 3 inliers the pose is returned as it was and num_inliers is
// 0.
PoseOptimizationResult OptimizePose(const CameraCalibration& calibration, double baseline_m,
                                    std::span<const PoseObservation> observations, const Rigid3& camera_from_world,
                                    const PoseOptimizationOptions& options, const PosePrior* prior = nullptr);

}  // namespace tessera
