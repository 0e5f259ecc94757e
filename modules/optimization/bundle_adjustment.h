// Refines keyframe poses and landmark positions together.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/ids.h"
#include "core/result.h"
#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"

namespace tessera {

struct BundlePose {
  KeyframeId id;             // the solver goes by index; a point's ray comes from the lowest id that sees it
  Rigid3 camera_from_world;  // meters (mono: units of the map)
  bool is_fixed = false;     // held where it is: part of the gauge
};

struct BundlePoint {
  LandmarkId id;  // for the caller
  Eigen::Vector3d position_in_world = Eigen::Vector3d::Zero();
};

struct BundleObservation {
  int pose = -1;          // index into BundleProblem::poses
  int point = -1;         // index into BundleProblem::points
  PixelObservation seen;  // sigma_px: 1.2^level times the keypoint noise of level 0
};

// The known motion between two keyframes, in place of their common landmarks: constraints of the outer window.
struct RelativePoseConstraint {
  int from = -1;  // indices into BundleProblem::poses
  int to = -1;
  Rigid3 to_from_from;  // the motion to be kept: point_in_to = to_from_from * point_in_from
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();  // of Retract's tangent
};

struct BundleProblem {
  CameraCalibration calibration;
  double baseline_m = 0.0;  // as in Reprojection; > 0 where an observation has a right column
  std::vector<BundlePose> poses;
  std::vector<BundlePoint> points;
  std::vector<BundleObservation> observations;
  std::vector<RelativePoseConstraint> constraints;
  // Mono with one fixed pose leaves the scale free. Index of a pose whose distance to the fixed one is kept; -1: none,
  // since a second fixed pose, a right column or the constraints of a double window fix the scale.
  int scale_pose = -1;

  int num_fixed_poses() const;
  bool has_right() const;  // whether an observation has a right column
  // Fails unless indices are in range, a pose is fixed, and a scale pose is given only where it makes sense.
  Result<> Check() const;
};

struct BundleOptions {
  int max_num_iterations = 10;       // a round; a warm start takes 3 to 6
  int num_rounds = 2;                // after each, observations are sorted anew into inliers and outliers
  double function_tolerance = 1e-4;  // a round ends when a step lowers the cost by less than this part of it
  // Of the trust region at the start of a round, as Ceres has it: damping is the curvature's diagonal over this. The
  // slow modes of a long street have a curvature far below the diagonal: where they must move, begin with less damping.
  double initial_radius = 1e4;
  // The curvature of a large map is that of a long, curved valley. After each step the points follow the poses by
  // themselves, steps may climb for a moment, and the trust region grows fast and is kept from round to round
  // (README.md has the measurements); only the last round goes on to function_tolerance.
  bool has_slow_modes = false;
  // Up to this many free poses the reduced camera system is solved dense, above it sparse. Dense is the
  // faster for a local window, where nearly every keyframe shares landmarks with every other.
  int max_num_dense_poses = 60;
  // Solve with Ceres, for comparison: SchurSolver finds the same minimum in a fraction of the time.
  bool is_always_ceres = false;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// For a whole map after a loop was closed: little damping, and steps that gain little are worth taking: a street may
// move by meters for a millionth of the cost.
BundleOptions GlobalBundleOptions();

struct BundleResult {
  std::vector<Rigid3> camera_from_world;            // by pose; fixed ones to the bit as given
  std::vector<Eigen::Vector3d> positions_in_world;  // by point; as given where no inlier observation moves it
  std::vector<char> is_inlier;                      // by observation: 1 if in front of the camera and within Chi2Limit
  int num_inliers = 0;
  double initial_cost = 0.0;  // half the robust sum of squares before the first round, over its observations
  double final_cost = 0.0;    // after the last round, over those that took part in it
  int num_iterations = 0;     // of all rounds
};

// Minimizes over the free camera_from_world and all points, by Levenberg-Marquardt with the points eliminated (Schur),
//
//   1/2 sum_obs rho(|e|^2) + 1/2 sum_constraints r' information r
//
//   e = (project(camera_from_world * position_in_world) - pixel) / sigma_px          2 or 3 rows, see Reprojection
//   to.camera_from_world * from.camera_from_world^-1 = Retract(to_from_from, r)      6 rows
//
// with Huber's rho at the chi-square limits of 95 %. After each round, observations that stand behind the camera or
// exceed the limit take no part in the next; they may return. A round that changes none of them is the last.
//
// With poses that only constraints hold this is the double window of H. Strasdat, A. Davison, J. M. M. Montiel,
// K. Konolige, "Double Window Optimisation for Constant Time Visual SLAM", ICCV 2011: reprojection errors inside,
// relative poses outside. With two poses it is the first bundle adjustment of mono initialization (scale_pose = the
// second).
//
// The result is a pure function of the values given; the order of the lists decides its last bits only. Throws
// std::invalid_argument with Check()'s sentence where problem or options are malformed. nullopt where there is nothing
// to optimize (no usable observation or constraint on anything free), a value is not finite, or the solver found no
// step.
std::optional<BundleResult> AdjustBundle(const BundleProblem& problem, const BundleOptions& options);

}  // namespace tessera
