#include "geometry/reprojection.h"

namespace tessera {

Eigen::Vector3d ReprojectionResidual(const CameraCalibration& calibration, double baseline_m,
                                     const Eigen::Vector3d& point_in_camera, const PixelObservation& observation) {
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

Reprojection Reproject(const CameraCalibration& calibration, double baseline_m, const Eigen::Vector3d& point_in_camera,
                       const PixelObservation& observation) {
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

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

}  // namespace tessera
