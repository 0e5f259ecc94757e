#include "geometry/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace tessera {
namespace {

struct PointEquations {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0.0;
  double max_chi2 = 0.0;
  int worst_view = -1;
};

// nullopt if a camera has the point behind it.
std::optional<PointEquations> Linearize(const CameraCalibration& calibration, double baseline_m,
                                        std::span<const PointView> views, const Eigen::Vector3d& point_in_world) {
  PointEquations equations;
  for (size_t i = 0; i < views.size(); ++i) {
    const Eigen::Matrix3d rotation = views[i].camera_from_world.rotation.toRotationMatrix();
    const Eigen::Vector3d point = rotation * point_in_world + views[i].camera_from_world.translation;
    if (point.z() < kMinDepth) {
      return std::nullopt;
    }
    const Reprojection r = Reproject(calibration, baseline_m, point, views[i].seen);
    const Eigen::Matrix3d by_world = r.by_point * rotation;
    const double chi2 = r.residual.squaredNorm();
    const double corner = Chi2Limit(views[i].seen.has_right());
    const double weight = HuberWeight(chi2, corner);
    equations.information.noalias() += weight * by_world.transpose() * by_world;
    equations.gradient.noalias() += weight * by_world.transpose() * r.residual;
    equations.cost += HuberLoss(chi2, corner);
    if (chi2 > equations.max_chi2 || equations.worst_view < 0) {
      equations.max_chi2 = chi2;
      equations.worst_view = static_cast<int>(i);
    }
  }
  return equations;
}

}  // namespace

std::optional<Eigen::Vector3d> TriangulateRays(const Rigid3& second_from_first, const Eigen::Vector3d& ray_in_first,
                                               const Eigen::Vector3d& ray_in_second) {
  // depth_second * ray_in_second = R depth_first ray_in_first + t. Rows (x, y) of both views, unknown point X:
  //   ray.x * P.row(2) X = P.row(0) X,  ray.y * P.row(2) X = P.row(1) X
  const Eigen::Matrix3d rotation = second_from_first.rotation.toRotationMatrix();
  const Eigen::Vector3d& t = second_from_first.translation;
  Eigen::Matrix<double, 4, 3> a;
  Eigen::Vector4d b;
  a.row(0) << 1.0, 0.0, -ray_in_first.x();
  a.row(1) << 0.0, 1.0, -ray_in_first.y();
  a.row(2) = rotation.row(0) - ray_in_second.x() * rotation.row(2);
  a.row(3) = rotation.row(1) - ray_in_second.y() * rotation.row(2);
  b << 0.0, 0.0, ray_in_second.x() * t.z() - t.x(), ray_in_second.y() * t.z() - t.y();
  const Eigen::Matrix3d normal = a.transpose() * a;
  const double determinant = normal.determinant();
  if (!(std::abs(determinant) > 1e-14)) {
    return std::nullopt;
  }
  const Eigen::Vector3d point = normal.inverse() * (a.transpose() * b);
  return point.allFinite() ? std::optional(point) : std::nullopt;
}

std::optional<Eigen::Vector3d> PointFromDisparity(const CameraCalibration& calibration, double baseline_m,
                                                  const PixelObservation& seen) {
  const double disparity_px = seen.pixel_px.x() - seen.right_x_px;
  if (!seen.has_right() || !(disparity_px > 0.0)) {
    return std::nullopt;
  }
  const double z = calibration.fx_px * baseline_m / disparity_px;
  return Eigen::Vector3d(z * calibration.Ray(seen.pixel_px));
}

std::optional<PointRefinement> RefinePoint(const CameraCalibration& calibration, double baseline_m,
                                           std::span<const PointView> views, const Eigen::Vector3d& point_in_world,
                                           int max_iterations) {
  Eigen::Vector3d point = point_in_world;
  std::optional<PointEquations> equations = Linearize(calibration, baseline_m, views, point);
  if (!equations) {
    return std::nullopt;
  }
  double damping = 0.0;  // plain Gauss-Newton until a step fails
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::Matrix3d damped = equations->information;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::Vector3d step = damped.ldlt().solve(-equations->gradient);
    if (!step.allFinite()) {
      return std::nullopt;
    }
    const std::optional<PointEquations> next = Linearize(calibration, baseline_m, views, point + step);
    if (next && next->cost <= equations->cost) {
      point += step;
      const bool converged = equations->cost - next->cost < 1e-6 * (1.0 + next->cost);
      equations = next;
      damping *= 0.1;
      if (converged) {
        break;
      }
    } else {
      damping = damping == 0.0 ? 1e-3 : 10.0 * damping;
    }
  }
  Eigen::Matrix3d covariance;
  bool is_invertible = false;
  equations->information.computeInverseWithCheck(covariance, is_invertible);
  if (!is_invertible || !covariance.allFinite()) {
    return std::nullopt;
  }
  return PointRefinement{point, covariance, equations->max_chi2, equations->worst_view};
}

double CosParallax(const Eigen::Vector3d& point, const Eigen::Vector3d& center_a, const Eigen::Vector3d& center_b) {
  const Eigen::Vector3d a = center_a - point, b = center_b - point;
  return a.dot(b) / std::sqrt(a.squaredNorm() * b.squaredNorm());
}

}  // namespace tessera
