#include "geometry/epipolar.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/decompositions.h"
#include "geometry/reprojection.h"

namespace tessera {
namespace {

using Vector5d = Eigen::Matrix<double, 5, 1>;

// The measurements' null vector as a row-major 3x3 matrix; nullopt if they don't fix one.
std::optional<Eigen::Matrix3d> NullMatrix(const Matrix9d& normal) {
  const std::optional<Vector9d> v = NullVector(normal);
  if (!v) {
    return std::nullopt;
  }
  return Eigen::Matrix3d(Eigen::Matrix3d::Map(v->data()).transpose());
}

// The larger eigenvalue of a symmetric 2x2 matrix, given by its lower triangle. It is tridiagonal as it is, which
// spares Eigen's first step.
double LargerEigenvalue(const Eigen::Matrix2d& matrix) {
  const double largest = std::max({std::abs(matrix(0, 0)), std::abs(matrix(1, 0)), std::abs(matrix(1, 1))});
  const double scale = largest > 0.0 ? largest : 1.0;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeFromTridiagonal(matrix.diagonal() / scale, matrix.diagonal<-1>() / scale, Eigen::EigenvaluesOnly);
  return scale * solver.eigenvalues().maxCoeff();
}

// Two unit vectors that, with the unit vector v, form a right-handed orthonormal frame.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& v) {
  const Eigen::Vector3d axis = std::abs(v.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = v.cross(axis).normalized();
  basis.col(1) = v.cross(basis.col(0));
  return basis;
}

// The motion one step of (rotation [rad], direction of translation [rad in its tangent plane]) away.
Rigid3 StepMotion(const Rigid3& motion, const Eigen::Matrix<double, 3, 2>& basis, const Vector5d& step) {
  const Eigen::Vector3d t = motion.translation + basis * step.tail<2>();
  return {(ExpSO3(step.head<3>()) * motion.rotation).normalized(), t.normalized()};
}

struct MotionEquations {
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Zero();
  Vector5d gradient = Vector5d::Zero();
};

// Normal equations of the Huber-weighted Sampson distances; derivatives are numeric: five more essential matrices.
MotionEquations Linearize(std::span<const RayPair> pairs, const Rigid3& motion,
                          const Eigen::Matrix<double, 3, 2>& basis, double corner) {
  constexpr double kStep = 1e-7;  // rad
  const Eigen::Matrix3d essential = EssentialFromMotion(motion);
  std::array<Eigen::Matrix3d, 5> moved;
  for (int k = 0; k < 5; ++k) {
    moved[static_cast<size_t>(k)] = EssentialFromMotion(StepMotion(motion, basis, kStep * Vector5d::Unit(k)));
  }
  MotionEquations equations;
  for (const RayPair& pair : pairs) {
    const double distance = SampsonDistance(essential, pair);
    Vector5d by_step;
    for (int k = 0; k < 5; ++k) {
      by_step(k) = (SampsonDistance(moved[static_cast<size_t>(k)], pair) - distance) / kStep;
    }
    const double weight = HuberWeight(distance * distance, corner * corner);
    equations.information.noalias() += weight * by_step * by_step.transpose();
    equations.gradient += weight * distance * by_step;
  }
  return equations;
}

// e = basis' d, where the expected direction d lies in the tangent plane of t: weight (sigma / prior's sigma)^2.
void AddPrior(const DirectionPrior& prior, double sigma, const Rigid3& motion, const Eigen::Matrix<double, 3, 2>& basis,
              MotionEquations& equations) {
  const Eigen::Vector3d expected = prior.DirectionFor(motion.rotation);
  const double weight = (sigma / prior.sigma_rad) * (sigma / prior.sigma_rad);
  equations.information.bottomRightCorner<2, 2>() += weight * Eigen::Matrix2d::Identity();
  equations.gradient.tail<2>() -= weight * (basis.transpose() * expected);
}

}  // namespace

Eigen::Matrix3d EssentialFromMotion(const Rigid3& second_from_first) {
  return Skew(second_from_first.translation) * second_from_first.rotation.toRotationMatrix();
}

std::optional<Eigen::Matrix3d> EssentialFromPairs(std::span<const RayPair> pairs) {
  Matrix9d normal = Matrix9d::Zero();
  for (const RayPair& pair : pairs) {
    Vector9d row;  // second' E first = row . (E row by row)
    row << pair.second.x() * pair.first, pair.second.y() * pair.first, pair.first;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  const std::optional<Eigen::Matrix3d> raw = NullMatrix(normal);
  if (!raw) {
    return std::nullopt;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(*raw, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Matrix3d(svd.matrixU() * Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal() * svd.matrixV().transpose());
}

std::optional<Eigen::Matrix3d> HomographyFromPairs(std::span<const RayPair> pairs) {
  Matrix9d normal = Matrix9d::Zero();
  for (const RayPair& pair : pairs) {
    Vector9d row;
    row << pair.first, Eigen::Vector3d::Zero(), -pair.second.x() * pair.first;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
    row << Eigen::Vector3d::Zero(), pair.first, -pair.second.y() * pair.first;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
  }
  const std::optional<Eigen::Matrix3d> homography = NullMatrix(normal);
  if (!homography || std::abs(homography->determinant()) < 1e-9) {
    return std::nullopt;
  }
  return homography;
}

double SampsonDistance(const Eigen::Matrix3d& essential, const RayPair& pair) {
  const Eigen::Vector3d line_in_second = essential * pair.first;
  const Eigen::Vector3d line_in_first = essential.transpose() * pair.second;
  const double scale_squared = line_in_second.head<2>().squaredNorm() + line_in_first.head<2>().squaredNorm();
  return scale_squared > 0.0 ? pair.second.dot(line_in_second) / std::sqrt(scale_squared) : 0.0;
}

double TransferErrorSquared(const Eigen::Matrix3d& homography, const RayPair& pair) {
  const Eigen::Vector3d moved = homography * pair.first;
  return (moved.head<2>() / moved.z() - pair.second.head<2>()).squaredNorm();
}

std::vector<Rigid3> MotionsFromEssential(const Eigen::Matrix3d& essential) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d w;  // quarter turn about z
  w << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  const Eigen::Vector3d t = svd.matrixU().col(2);
  std::vector<Rigid3> motions;
  for (const Eigen::Matrix3d& turn : {w, Eigen::Matrix3d(w.transpose())}) {
    Eigen::Matrix3d rotation = svd.matrixU() * turn * svd.matrixV().transpose();
    rotation *= rotation.determinant() < 0.0 ? -1.0 : 1.0;
    motions.push_back(Rigid3::FromMatrix(rotation, t));
    motions.push_back(Rigid3::FromMatrix(rotation, -t));
  }
  return motions;
}

std::vector<Rigid3> MotionsFromHomography(const Eigen::Matrix3d& homography) {
  // H = R + t n'/d has 1 as its middle singular value. H'H = V diag(s1^2, 1, s3^2) V', s1 >= 1 >= s3.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(homography, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = homography.determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d h = sign / svd.singularValues()(1) * homography;
  const double s1 = svd.singularValues()(0) / svd.singularValues()(1);
  const double s3 = svd.singularValues()(2) / svd.singularValues()(1);
  const double spread = s1 * s1 - s3 * s3;
  if (!(spread > 1e-8)) {
    return {};
  }
  // u is a direction that H keeps in length, besides v2: both span a plane through the origin that H maps rigidly.
  const Eigen::Matrix3d& v = svd.matrixV();
  const double a = std::sqrt(std::max(0.0, 1.0 - s3 * s3)), b = std::sqrt(std::max(0.0, s1 * s1 - 1.0));
  std::vector<Rigid3> motions;
  for (const double side : {1.0, -1.0}) {
    const Eigen::Vector3d u = (a * v.col(0) + side * b * v.col(2)) / std::sqrt(spread);
    Eigen::Matrix3d from, to;
    from << v.col(1), u, v.col(1).cross(u);
    const Eigen::Vector3d h_v = h * v.col(1), h_u = h * u;
    to << h_v, h_u, h_v.cross(h_u);
    const Eigen::Matrix3d rotation = to * from.transpose();
    const Eigen::Vector3d normal = from.col(2);
    const Eigen::Vector3d t = ((h - rotation) * normal).normalized();
    motions.push_back(Rigid3::FromMatrix(rotation, t));
    motions.push_back(Rigid3::FromMatrix(rotation, -t));
  }
  return motions;
}

Eigen::Vector3d DirectionPrior::DirectionFor(const Eigen::Quaterniond& second_from_first) const {
  return -(HalfOf(second_from_first) * way.normalized());
}

RefinedMotion RefineMotion(std::span<const RayPair> pairs, const Rigid3& second_from_first, double corner,
                           const DirectionPrior* prior, double sigma) {
  constexpr int kMaxIterations = 10;
  RefinedMotion result;
  result.second_from_first = {second_from_first.rotation, second_from_first.translation.normalized()};
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::Matrix<double, 3, 2> basis = TangentBasis(result.second_from_first.translation);
    MotionEquations equations = Linearize(pairs, result.second_from_first, basis, corner);
    if (prior != nullptr) AddPrior(*prior, sigma, result.second_from_first, basis, equations);
    result.information = equations.information;
    const Vector5d step = equations.information.ldlt().solve(-equations.gradient);
    if (!step.allFinite() || step.norm() > 1.0) {
      break;
    }
    result.second_from_first = StepMotion(result.second_from_first, basis, step);
    if (step.norm() < 1e-8) {
      break;
    }
  }
  return result;
}

double DirectionSigma(const RefinedMotion& motion, double sigma) {
  const Eigen::Matrix<double, 5, 5> covariance = InverseOf(motion.information);
  if (!covariance.allFinite()) {
    return std::numeric_limits<double>::infinity();
  }
  const double largest = LargerEigenvalue(covariance.bottomRightCorner<2, 2>());
  return largest > 0.0 ? sigma * std::sqrt(largest) : std::numeric_limits<double>::infinity();
}

}  // namespace tessera
