// How a point in space and a camera pose give pixels, with derivatives: what pose, structure and test code share.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "geometry/camera.h"

namespace tessera {

// Points with a smaller z (meters, or units of the map) count as behind the camera.
inline constexpr double kMinDepth = 1e-6;

inline constexpr double kNoColumn = std::numeric_limits<double>::quiet_NaN();

// Where an image shows a point. A depth z is carried as the column that a right camera `baseline_m` away would see,
// u_right = u - fx baseline / z: for a stereo pair that is what was measured, and for a structured-light RGB-D camera
// the error of its depth grows with z^2 as that of a disparity does.
struct PixelObservation {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();
  double right_x_px = kNoColumn;  // column in the right image, may lie outside of it; kNoColumn: not known
  double sigma_px = 1.0;          // standard deviation of each coordinate
  // > 0: a depth sensor measured the disparity by itself, with this standard deviation; else the right column was found
  // in an image, as exactly as the left one.
  double disparity_sigma_px = 0.0;

  bool has_right() const { return !std::isnan(right_x_px); }
};

// r = (u, v, u_right)(point_in_camera) - observation, and dr/d(point_in_camera), both divided by sigma_px. The third
// row is zero where the observation has no right column.
struct Reprojection {
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();
};

// The residual alone.
inline Eigen::Vector3d ReprojectionResidual(const CameraCalibration& calibration, double baseline_m,
                                            const Eigen::Vector3d& point_in_camera,
                                            const PixelObservation& observation) {
  const double inverse_z = 1.0 / point_in_camera.z();
  const double u = calibration.fx_px * point_in_camera.x() * inverse_z + calibration.cx_px;
  const double v = calibration.fy_px * point_in_camera.y() * inverse_z + calibration.cy_px;
  const double disparity = calibration.fx_px * baseline_m * inverse_z;
  const double weight = 1.0 / observation.sigma_px;
  double third = 0.0;
  if (observation.has_right()) {
    third = observation.disparity_sigma_px > 0.0
                ? (observation.pixel_px.x() - disparity - observation.right_x_px) / observation.disparity_sigma_px
                : weight * (u - disparity - observation.right_x_px);
  }
  return {weight * (u - observation.pixel_px.x()), weight * (v - observation.pixel_px.y()), third};
}

// `point_in_camera` must have z > 0; baseline_m > 0 where the observation has a right column.
inline Reprojection Reproject(const CameraCalibration& calibration, double baseline_m,
                              const Eigen::Vector3d& point_in_camera, const PixelObservation& observation) {
  Reprojection result;
  result.residual = ReprojectionResidual(calibration, baseline_m, point_in_camera, observation);
  // u = fx x/z + cx:                 du/dx = fx/z,  du/dz = -fx x/z^2
  // u_right = fx (x - baseline)/z:   the same with x - baseline for x
  const double inverse_z = 1.0 / point_in_camera.z();
  const double x = point_in_camera.x() * inverse_z, y = point_in_camera.y() * inverse_z;
  const double fx = calibration.fx_px * inverse_z / observation.sigma_px;
  const double fy = calibration.fy_px * inverse_z / observation.sigma_px;
  result.by_point.row(0) << fx, 0.0, -fx * x;
  result.by_point.row(1) << 0.0, fy, -fy * y;
  // disparity = fx baseline / z, of which the residual has the negative
  if (observation.has_right() && observation.disparity_sigma_px > 0.0) {
    const double per_z = calibration.fx_px * inverse_z / observation.disparity_sigma_px;
    result.by_point.row(2) << 0.0, 0.0, per_z * baseline_m * inverse_z;
  } else if (observation.has_right()) {
    result.by_point.row(2) << fx, 0.0, -fx * (x - baseline_m * inverse_z);
  }
  return result;
}

// |residual|^2, number by number: a vector that was put together from single numbers a moment ago can't be loaded as
// one without waiting for them.
inline double SquaredNorm(const Eigen::Vector3d& residual) {
  return residual.x() * residual.x() + residual.y() * residual.y() + residual.z() * residual.z();
}

// 95 % of observations without a gross error have a squared residual below this (chi-square, 2 or 3 degrees of
// freedom).
inline double Chi2Limit(bool has_right) { return has_right ? 7.815 : 5.991; }
// The same for one degree of freedom: a distance from a line, or a depth.
inline constexpr double kChi2LimitOfOne = 3.841;

// Huber's loss of a squared residual, with its corner at `corner_squared`, in the same units.
inline double HuberLoss(double squared, double corner_squared) {
  return squared <= corner_squared ? squared : 2.0 * std::sqrt(squared * corner_squared) - corner_squared;
}
// Its derivative, the weight of the squared residual: 1 below the corner, then falling like 1/|r|.
inline double HuberWeight(double squared, double corner_squared) {
  return squared <= corner_squared ? 1.0 : std::sqrt(corner_squared / squared);
}

// [v]x, so that Skew(v) * w = v x w.
inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace tessera
