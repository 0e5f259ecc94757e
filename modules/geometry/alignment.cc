#include "geometry/alignment.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

namespace tessera {
namespace {

Eigen::Vector3d Mean(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

}  // namespace

std::optional<Alignment> AlignPoints(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                                     bool with_scale) {
  if (a.size() < 3) return std::nullopt;
  // C = sum (b_i - mean b)(a_i - mean a)' = U D V',  R = U S V',  S = diag(1, 1, det U det V),
  // scale = tr(D S) / sum |a_i - mean a|^2,  t = mean b - scale R mean a
  const Eigen::Vector3d mean_a = Mean(a), mean_b = Mean(b);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double spread_a = 0.0;
  for (size_t i = 0; i < a.size(); ++i) {
    covariance.noalias() += (b[i] - mean_b) * (a[i] - mean_a).transpose();
    spread_a += (a[i] - mean_a).squaredNorm();
  }
  if (!(spread_a > 0.0)) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1.0, 1.0, 1.0);
  signs.z() = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();

  Alignment result;
  result.b_from_a.rotation = Eigen::Quaterniond(rotation).normalized();
  result.b_from_a.scale = with_scale ? svd.singularValues().dot(signs) / spread_a : 1.0;
  result.b_from_a.translation = mean_b - result.b_from_a.scale * (rotation * mean_a);
  double sum = 0.0;
  for (size_t i = 0; i < a.size(); ++i) sum += (result.b_from_a * a[i] - b[i]).squaredNorm();
  result.rms = std::sqrt(sum / static_cast<double>(a.size()));
  return result;
}

}  // namespace tessera
