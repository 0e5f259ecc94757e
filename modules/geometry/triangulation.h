// Points in space from the pixels that show them, with camera poses known.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"

namespace tessera {

// One camera that sees the point.
struct PointView {
  Rigid3 camera_from_world;
  PixelObservation seen;
};

// The point, in the first camera's frame, whose two projections lie nearest to the rays (linear least squares on
// x cross P X = 0, with rows scaled alike; Hartley & Zisserman, 12.2). Rays have z = 1. Depth may come out negative.
// nullopt where the rays are parallel.
std::optional<Eigen::Vector3d> TriangulateRays(const Rigid3& second_from_first, const Eigen::Vector3d& ray_in_first,
                                               const Eigen::Vector3d& ray_in_second);

// Point in the camera frame of an observation with a right column; nullopt if its disparity is not positive.
std::optional<Eigen::Vector3d> PointFromDisparity(const CameraCalibration& calibration, double baseline_m,
                                                  const PixelObservation& seen);

struct PointRefinement {
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2, poses taken as exact
  double max_chi2 = 0.0;                                 // of the view that agrees least
  int worst_view = -1;                                   // that view
};

// Minimizes the Huber-weighted reprojection error over the point alone, poses fixed, by Gauss-Newton with
// Levenberg's damping:  sum_i rho(|project(camera_i_from_world * point) - pixel_i|^2 / sigma_i^2).
// All views share one calibration. nullopt if the point leaves the front of a camera or the views don't fix it.
std::optional<PointRefinement> RefinePoint(const CameraCalibration& calibration, double baseline_m,
                                           std::span<const PointView> views, const Eigen::Vector3d& point_in_world,
                                           int max_iterations = 8);

// Cosine of the angle at `point` between the lines to the two camera centers.
double CosParallax(const Eigen::Vector3d& point, const Eigen::Vector3d& center_a, const Eigen::Vector3d& center_b);

}  // namespace tessera
