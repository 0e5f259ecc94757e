#include "geometry/absolute_pose.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "geometry/pose_optimization.h"
#include "geometry/reprojection.h"
#include "geometry/sampling.h"

namespace tessera {
namespace {

constexpr int kMinToRefine = 6;  // points: fewer hardly say more than the three that made the pose

// The four eigenvalues of a 4x4 matrix with zeros below its subdiagonal (a Hessenberg matrix).
std::array<std::complex<double>, 4> EigenvaluesOfHessenberg(const Eigen::Matrix4d& matrix) {
  // Eigen's EigenSolver would first bring it into that form.
  const double scale = matrix.cwiseAbs().maxCoeff();
  Eigen::RealSchur<Eigen::Matrix4d> schur;
  schur.computeFromHessenberg(Eigen::Matrix4d(matrix / scale), Eigen::Matrix4d(), false);
  const Eigen::Matrix4d t = schur.matrixT() * scale;  // triangular, but for 2x2 blocks of two conjugate eigenvalues
  std::array<std::complex<double>, 4> values;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<size_t>(i);
    if (i == 3 || t(i + 1, i) == 0.0) {
      values[k] = t(i, i);
      continue;
    }
    const double p = 0.5 * (t(i, i) - t(i + 1, i + 1));
    const double largest = std::max({std::abs(p), std::abs(t(i + 1, i)), std::abs(t(i, i + 1))});
    const double p0 = p / largest;
    const double z = largest * std::sqrt(std::abs(p0 * p0 + t(i + 1, i) / largest * (t(i, i + 1) / largest)));
    values[k] = {t(i + 1, i + 1) + p, z};
    values[k + 1] = std::conj(values[k]);
    ++i;
  }
  return values;
}

// Real roots of c[4] x^4 + ... + c[0], as eigenvalues of the companion matrix, each polished by Newton's method.
std::vector<double> RealRoots(const std::array<double, 5>& c) {
  if (!(std::abs(c[4]) > 1e-14)) {
    return {};
  }
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  companion.block<3, 3>(1, 0).setIdentity();
  companion.col(3) << -c[0] / c[4], -c[1] / c[4], -c[2] / c[4], -c[3] / c[4];
  if (!companion.allFinite()) {
    return {};
  }
  std::vector<double> roots;
  for (const std::complex<double>& root : EigenvaluesOfHessenberg(companion)) {
    double x = root.real();
    if (std::abs(root.imag()) > 1e-3 * (1.0 + std::abs(x))) {
      continue;
    }
    for (int step = 0; step < 3; ++step) {
      const double value = (((c[4] * x + c[3]) * x + c[2]) * x + c[1]) * x + c[0];
      const double slope = ((4.0 * c[4] * x + 3.0 * c[3]) * x + 2.0 * c[2]) * x + c[1];
      x -= std::abs(slope) > 1e-12 ? value / slope : 0.0;
    }
    roots.push_back(x);
  }
  return roots;
}

// Orthonormal frame of three points: x along the first side, z across both. nullopt if they lie on a line.
std::optional<Eigen::Matrix3d> FrameOf(const std::array<Eigen::Vector3d, 3>& points) {
  const Eigen::Vector3d side = points[1] - points[0];
  const Eigen::Vector3d across = side.cross(points[2] - points[0]);
  if (!(across.norm() > 1e-9 * side.squaredNorm())) {
    return std::nullopt;
  }
  Eigen::Matrix3d frame;
  frame.col(0) = side.normalized();
  frame.col(2) = across.normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

// Coefficients of Grunert's quartic in v = s3/s1, where s_i is the distance of point i, a, b, c are the sides opposite
// to points 1, 2, 3, and the cosines are of the angles between rays (2,3), (1,3), (1,2). p = (a^2 - c^2)/b^2 and so on.
std::array<double, 5> GrunertQuartic(double a2, double b2, double c2, double cos_a, double cos_b, double cos_c) {
  const double p = (a2 - c2) / b2, q = (a2 + c2) / b2, r = (b2 - c2) / b2, s = (b2 - a2) / b2;
  const double a = a2 / b2, c = c2 / b2;
  return {(1.0 + p) * (1.0 + p) - 4.0 * a * cos_c * cos_c,
          4.0 * (-p * (1.0 + p) * cos_b + 2.0 * a * cos_c * cos_c * cos_b - (1.0 - q) * cos_a * cos_c),
          2.0 * (p * p - 1.0 + 2.0 * p * p * cos_b * cos_b + 2.0 * r * cos_a * cos_a - 4.0 * q * cos_a * cos_b * cos_c +
                 2.0 * s * cos_c * cos_c),
          4.0 * (p * (1.0 - p) * cos_b - (1.0 - q) * cos_a * cos_c + 2.0 * c * cos_a * cos_a * cos_b),
          (p - 1.0) * (p - 1.0) - 4.0 * c * cos_a * cos_a};
}

// Points and their pixels by column, which compilers test four at a time. A point agrees with a pose that puts it to
// (x, y, z), z > 0, if that is within the chi-square limit c (in sigma) of its ray (a, b, 1):
//
//   (f_x (x - a z) / (c sigma))^2 + (f_y (y - b z) / (c sigma))^2 <= z^2
class PointColumns {
 public:
  PointColumns(const CameraCalibration& calibration, std::span<const PointPixel> points) {
    const double limit = std::sqrt(Chi2Limit(false));
    for (const PointPixel& point : points) {
      const Eigen::Vector3d ray = calibration.Ray(point.pixel_px);
      x_.push_back(point.point_in_world.x());
      y_.push_back(point.point_in_world.y());
      z_.push_back(point.point_in_world.z());
      a_.push_back(ray.x());
      b_.push_back(ray.y());
      x_weight_.push_back(calibration.fx_px / (limit * point.sigma_px));
      y_weight_.push_back(calibration.fy_px / (limit * point.sigma_px));
    }
  }

  // Stops, with fewer, where `more_than` can't be reached any more.
  int CountInliers(const Rigid3& camera_from_world, int more_than) const {
    constexpr size_t kBlock = 32;
    const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
    int num_inliers = 0;
    for (size_t begin = 0; begin < x_.size(); begin += kBlock) {
      if (num_inliers + static_cast<int>(x_.size() - begin) <= more_than) break;
      int64_t num_of_block = 0;
      for (size_t i = begin; i < std::min(begin + kBlock, x_.size()); ++i) {
        num_of_block += Fits(i, rotation, camera_from_world.translation);
      }
      num_inliers += static_cast<int>(num_of_block);
    }
    return num_inliers;
  }

  std::vector<char> FindInliers(const Rigid3& camera_from_world) const {
    const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
    std::vector<char> is_inlier(x_.size());
    for (size_t i = 0; i < x_.size(); ++i) {
      is_inlier[i] = static_cast<char>(Fits(i, rotation, camera_from_world.translation));
    }
    return is_inlier;
  }

 private:
  // 1 or 0, as wide as a double.
  int64_t Fits(size_t i, const Eigen::Matrix3d& r, const Eigen::Vector3d& t) const {
    const double x = r(0, 0) * x_[i] + r(0, 1) * y_[i] + r(0, 2) * z_[i] + t.x();
    const double y = r(1, 0) * x_[i] + r(1, 1) * y_[i] + r(1, 2) * z_[i] + t.y();
    const double z = r(2, 0) * x_[i] + r(2, 1) * y_[i] + r(2, 2) * z_[i] + t.z();
    const double x_off = x_weight_[i] * (x - a_[i] * z), y_off = y_weight_[i] * (y - b_[i] * z);
    return static_cast<int64_t>(z > 0.0) & static_cast<int64_t>(x_off * x_off + y_off * y_off <= z * z);
  }

  std::vector<double> x_, y_, z_, a_, b_, x_weight_, y_weight_;
};

// The best pose by the points that agree with `pose`.
AbsolutePose Refined(const CameraCalibration& calibration, std::span<const PointPixel> points,
                     const PointColumns& columns, const AbsolutePose& pose) {
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!pose.is_inlier[i]) continue;
    PixelObservation seen;
    seen.pixel_px = points[i].pixel_px;
    seen.sigma_px = points[i].sigma_px;
    observations.push_back({.point_in_world = points[i].point_in_world, .seen = seen});
  }
  const Rigid3 refined = OptimizePose(calibration, 0.0, observations, pose.camera_from_world, {}).camera_from_world;
  return {refined, columns.FindInliers(refined), columns.CountInliers(refined, -1)};
}

}  // namespace

std::vector<Rigid3> PosesFromThreePoints(const std::array<Eigen::Vector3d, 3>& points_in_world,
                                         const std::array<Eigen::Vector3d, 3>& rays_in_camera) {
  const std::optional<Eigen::Matrix3d> world_frame = FrameOf(points_in_world);
  if (!world_frame) {
    return {};
  }
  const Eigen::Vector3d r1 = rays_in_camera[0].normalized(), r2 = rays_in_camera[1].normalized(),
                        r3 = rays_in_camera[2].normalized();
  const double a2 = (points_in_world[1] - points_in_world[2]).squaredNorm();
  const double b2 = (points_in_world[0] - points_in_world[2]).squaredNorm();
  const double c2 = (points_in_world[0] - points_in_world[1]).squaredNorm();
  const double cos_a = r2.dot(r3), cos_b = r1.dot(r3), cos_c = r1.dot(r2);
  const double p = (a2 - c2) / b2;
  std::vector<Rigid3> poses;
  for (const double v : RealRoots(GrunertQuartic(a2, b2, c2, cos_a, cos_b, cos_c))) {
    const double divisor = 2.0 * (cos_c - v * cos_a);
    const double u = ((-1.0 + p) * v * v - 2.0 * p * cos_b * v + 1.0 + p) / divisor;
    const double s1_squared = b2 / (1.0 + v * v - 2.0 * v * cos_b);
    if (!(std::abs(divisor) > 1e-12) || !(u > 0.0) || !(v > 0.0) || !(s1_squared > 0.0)) {
      continue;
    }
    const double s1 = std::sqrt(s1_squared);
    const std::array<Eigen::Vector3d, 3> in_camera = {s1 * r1, u * s1 * r2, v * s1 * r3};
    const std::optional<Eigen::Matrix3d> camera_frame = FrameOf(in_camera);
    if (camera_frame) {
      const Eigen::Matrix3d rotation = *camera_frame * world_frame->transpose();
      poses.push_back(Rigid3::FromMatrix(rotation, in_camera[0] - rotation * points_in_world[0]));
    }
  }
  return poses;
}

std::optional<AbsolutePose> EstimateAbsolutePose(const CameraCalibration& calibration,
                                                 std::span<const PointPixel> points, uint64_t seed,
                                                 const AbsolutePoseOptions& options) {
  if (points.size() < static_cast<size_t>(std::max(3, options.min_inliers))) {
    return std::nullopt;
  }
  const PointColumns columns(calibration, points);
  AbsolutePose best;
  ForEachSample<3>(seed, points.size(), options.ransac_iterations, [&](const std::array<size_t, 3>& sample) {
    std::array<Eigen::Vector3d, 3> in_world, rays;
    for (size_t k = 0; k < 3; ++k) {
      in_world[k] = points[sample[k]].point_in_world;
      rays[k] = calibration.Ray(points[sample[k]].pixel_px);
    }
    for (const Rigid3& pose : PosesFromThreePoints(in_world, rays)) {
      const int num_inliers = columns.CountInliers(pose, best.num_inliers);
      if (num_inliers > best.num_inliers) best = {.camera_from_world = pose, .num_inliers = num_inliers};
    }
  });
  best.is_inlier = columns.FindInliers(best.camera_from_world);
  for (int i = 0; i < options.max_refinements && best.num_inliers >= kMinToRefine; ++i) {
    AbsolutePose refined = Refined(calibration, points, columns, best);
    if (refined.num_inliers <= best.num_inliers) break;
    best = std::move(refined);
  }
  return best.num_inliers >= options.min_inliers ? std::optional(best) : std::nullopt;
}

}  // namespace tessera
