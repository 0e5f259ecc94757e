#include "geometry/similarity_problem.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <limits>

#include "geometry/decompositions.h"

namespace tessera {
namespace {

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxDepthResidual = 3.0;  // sigmas; the depths of far points have long tails
constexpr double kFirstDamping = 1e-6;     // of the diagonal; nearly Gauss-Newton from a fair start
constexpr double kMaxDamping = 1e6;
constexpr double kEnoughGain = 1e-8;  // a step that lowers the cost by a smaller part of it ends the round

// r' W r and W J with W = (I + a a')^-1 = I - a a' / (1 + a'a), where a is what a standard deviation of depth moves.
double WhitenedSquare(const Eigen::Vector3d& residual, const Eigen::Vector3d& spread) {
  const double along = spread.dot(residual);
  return residual.squaredNorm() - along * along / (1.0 + spread.squaredNorm());
}

}  // namespace

// The normal equations, by Retract's tangent.
struct SimilarityProblem::Linear {
  Matrix7d information = Matrix7d::Zero();
  Vector7d gradient = Vector7d::Zero();

  // Adds rho(r' W r) with d(residual)/d(tangent) = by_tangent.
  void Add(const Eigen::Vector3d& residual, const Eigen::Matrix<double, 3, 7>& by_tangent,
           const Eigen::Vector3d& spread, double corner_squared) {
    const double loss = HuberWeight(WhitenedSquare(residual, spread), corner_squared);
    const Eigen::Matrix3d weight =
        loss * (Eigen::Matrix3d::Identity() - spread * spread.transpose() / (1.0 + spread.squaredNorm()));
    const Eigen::Matrix<double, 7, 3> weighted = by_tangent.transpose() * weight;
    information.noalias() += weighted * by_tangent;
    gradient.noalias() += weighted * residual;
  }
};

SimilarityProblem::SimilarityProblem(const CameraCalibration& calibration, std::span<const PointPair> pairs,
                                     const SimilarityOptions& options)
    : calibration_(calibration), options_(options), num_pairs_(pairs.size()) {
  for (const PointPair& pair : pairs) {
    Append(pair.point_in_second, pair.seen_second, pair.seen_first, in_first_);
    Append(pair.point_in_first, pair.seen_first, pair.seen_second, in_second_);
  }
}

void SimilarityProblem::Append(const Eigen::Vector3d& point, const PixelObservation& seen_with_it,
                               PixelObservation seen_by_other, Sights& sights) const {
  seen_by_other.sigma_px *= options_.sigma_factor;
  seen_by_other.right_x_px = options_.baseline_m > 0.0 ? seen_by_other.right_x_px : kNoColumn;
  // disparity = fx baseline / z:  sigma_z / z = sigma_px z / (fx baseline)
  const bool has_depth = options_.baseline_m > 0.0 && seen_with_it.has_right();
  const double measured =
      has_depth ? seen_with_it.sigma_px * point.z() / (calibration_.fx_px * options_.baseline_m) : options_.depth_sigma;
  sights.points.push_back(point);
  sights.seen.push_back(seen_by_other);
  sights.depth_sigmas.push_back(std::min(options_.depth_sigma, measured));
  sights.spreads.push_back(Eigen::Vector3d::Zero());
}

bool SimilarityProblem::Fits(const Sim3& viewer_from_owner, double factor, size_t i, Sights& sights) const {
  const Eigen::Vector3d point = viewer_from_owner * sights.points[i];
  if (!(sights.points[i].z() >= kMinDepth) || !(point.z() >= kMinDepth)) return false;
  const Reprojection seen = Reproject(calibration_, options_.baseline_m, point, sights.seen[i]);
  // d(point)/d(ln depth) = point - (center of the owner's camera)
  sights.spreads[i] = sights.depth_sigmas[i] * (seen.by_point * (point - viewer_from_owner.translation));
  return WhitenedSquare(seen.residual, sights.spreads[i]) <= factor * Chi2Limit(sights.seen[i].has_right());
}

SimilarityEstimate SimilarityProblem::Classify(const Sim3& first_from_second, double factor) {
  const Sim3 second_from_first = first_from_second.Inverse();
  SimilarityEstimate estimate{first_from_second, std::vector<char>(num_pairs_, 0), 0, kInfinity};
  for (size_t i = 0; i < num_pairs_; ++i) {
    const double moved_z = (first_from_second * in_first_.points[i]).z();
    const bool fits =
        Fits(first_from_second, factor, i, in_first_) && Fits(second_from_first, factor, i, in_second_) &&
        (!UsesDepths() || std::abs(DepthResidual(moved_z, in_second_.points[i].z())) <= kMaxDepthResidual);
    estimate.is_inlier[i] = fits ? 1 : 0;
    estimate.num_inliers += fits ? 1 : 0;
  }
  return estimate;
}

double SimilarityProblem::Cost(const Eigen::Vector3d& point_in_viewer, size_t i, const Sights& sights) const {
  if (!(point_in_viewer.z() >= kMinDepth)) return kInfinity;
  const Eigen::Vector3d residual =
      ReprojectionResidual(calibration_, options_.baseline_m, point_in_viewer, sights.seen[i]);
  return 0.5 * HuberLoss(WhitenedSquare(residual, sights.spreads[i]), Chi2Limit(sights.seen[i].has_right()));
}

double SimilarityProblem::Cost(const SimilarityEstimate& estimate) const {
  const Sim3 second_from_first = estimate.first_from_second.Inverse();
  double cost = 0.0;
  for (size_t i = 0; i < num_pairs_; ++i) {
    if (!estimate.is_inlier[i]) continue;
    const Eigen::Vector3d point = estimate.first_from_second * in_first_.points[i];
    cost += Cost(point, i, in_first_) + Cost(second_from_first * in_second_.points[i], i, in_second_);
    if (UsesDepths() && std::isfinite(cost)) {
      const double depth = DepthResidual(point.z(), in_second_.points[i].z());
      cost += 0.5 * HuberLoss(depth * depth, kChi2LimitOfOne);
    }
  }
  return cost;
}

SimilarityProblem::Linear SimilarityProblem::Linearize(const SimilarityEstimate& estimate) const {
  const Sim3 second_from_first = estimate.first_from_second.Inverse();
  const Eigen::Matrix3d by_inverse = second_from_first.scale * second_from_first.rotation.toRotationMatrix();
  const double per_depth = 1.0 / (std::sqrt(2.0) * options_.depth_sigma);
  Linear linear;
  for (size_t i = 0; i < num_pairs_; ++i) {
    if (!estimate.is_inlier[i]) continue;
    // With S' = Retract(S, delta):  d(S' x)/d(delta) = [I, -[y]x, y] at y = S x,
    // and d(S'^-1 p)/d(delta) = -(dS^-1/dp) [I, -[p]x, p].
    const Eigen::Vector3d in_first = estimate.first_from_second * in_first_.points[i], back = in_second_.points[i];
    const Reprojection first = Reproject(calibration_, options_.baseline_m, in_first, in_first_.seen[i]);
    const Reprojection second =
        Reproject(calibration_, options_.baseline_m, second_from_first * back, in_second_.seen[i]);
    Eigen::Matrix<double, 3, 7> move, move_back;
    move << Eigen::Matrix3d::Identity(), -Skew(in_first), in_first;
    move_back << Eigen::Matrix3d::Identity(), -Skew(back), back;
    linear.Add(first.residual, first.by_point * move, in_first_.spreads[i], Chi2Limit(in_first_.seen[i].has_right()));
    linear.Add(second.residual, -second.by_point * by_inverse * move_back, in_second_.spreads[i],
               Chi2Limit(in_second_.seen[i].has_right()));
    if (UsesDepths()) {
      Eigen::Matrix<double, 3, 7> by_tangent = Eigen::Matrix<double, 3, 7>::Zero();
      by_tangent.row(0) = per_depth / in_first.z() * move.row(2);
      const Eigen::Vector3d depth(DepthResidual(in_first.z(), back.z()), 0.0, 0.0);
      linear.Add(depth, by_tangent, Eigen::Vector3d::Zero(), kChi2LimitOfOne);
    }
  }
  if (!options_.has_scale) {
    linear.information.row(6).setZero();
    linear.information.col(6).setZero();
    linear.information(6, 6) = 1.0;
    linear.gradient(6) = 0.0;
  }
  return linear;
}

void SimilarityProblem::Minimize(SimilarityEstimate& estimate) const {
  double cost = Cost(estimate), damping = kFirstDamping;
  for (int iteration = 0; iteration < options_.max_iterations && damping < kMaxDamping; ++iteration) {
    const Linear linear = Linearize(estimate);
    for (bool is_accepted = false; !is_accepted && damping < kMaxDamping;) {
      Matrix7d damped = linear.information;
      damped.diagonal() *= 1.0 + damping;
      const Vector7d step = damped.ldlt().solve(-linear.gradient);
      SimilarityEstimate moved = estimate;
      moved.first_from_second = Retract(estimate.first_from_second, step);
      const double moved_cost = step.allFinite() ? Cost(moved) : kInfinity;
      is_accepted = moved_cost < cost;
      damping *= is_accepted ? 0.1 : 10.0;
      if (is_accepted) {
        const bool is_done = cost - moved_cost < kEnoughGain * cost;
        estimate.first_from_second = moved.first_from_second;
        cost = moved_cost;
        if (is_done) return;
      }
    }
  }
}

double SimilarityProblem::RotationSigma(const SimilarityEstimate& estimate) const {
  const Matrix7d covariance = InverseOf(Linearize(estimate).information);
  if (!covariance.allFinite()) return kInfinity;
  const Eigen::Matrix3d of_rotation = covariance.block<3, 3>(3, 3);
  const Eigen::Vector3d variances =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(of_rotation, Eigen::EigenvaluesOnly).eigenvalues();
  // Rounding makes a negative variance of an infinite one.
  return variances.minCoeff() > 0.0 ? std::sqrt(variances.maxCoeff()) : kInfinity;
}

SimilarityEstimate SimilarityProblem::Refine(const Sim3& first_from_second, int num_rounds, double first_factor) {
  SimilarityEstimate estimate = Classify(first_from_second, first_factor);
  for (int round = 0; round < num_rounds && estimate.num_inliers >= kMinSimilarityInliers; ++round) {
    const std::vector<char> took_part = estimate.is_inlier;
    Minimize(estimate);
    estimate = Classify(estimate.first_from_second, 1.0);
    if (estimate.is_inlier == took_part) break;
  }
  return estimate;
}

}  // namespace tessera
