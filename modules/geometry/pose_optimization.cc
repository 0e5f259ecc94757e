#include "geometry/pose_optimization.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

namespace tessera {
namespace {

constexpr int kMinInliers = 3;  // points that fix six degrees of freedom

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// A nearer point than a fifth of its estimated distance is out of reach of a depth correction.
constexpr double kMinInverseRatio = 0.2;

struct NormalEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

// The linearized residual of one observation, by u.
struct LinearTerm {
  Reprojection reprojection;
  Eigen::Vector3d by_depth;
};

// The residual by the pose's left perturbation: d(point)/d(delta) = [I, -[point]x] for Retract.
Eigen::Matrix<double, 3, 6> ByPose(const Reprojection& reprojection, const Eigen::Vector3d& point_in_camera) {
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << reprojection.by_point, -reprojection.by_point * Skew(point_in_camera);
  return by_pose;
}

class PoseProblem {
 public:
  PoseProblem(const CameraCalibration& calibration, double baseline_m, std::span<const PoseObservation> observations,
              const Rigid3& camera_from_world, const PosePrior* prior)
      : prior_(prior),
        calibration_(calibration),
        baseline_m_(baseline_m),
        observations_(observations),
        is_inlier_(observations.size(), 1),
        depths_(observations.size()) {
    const Eigen::Vector3d camera_in_world = camera_from_world.Inverse().translation;
    for (size_t i = 0; i < depths_.size(); ++i) {
      const PoseObservation& o = observations[i];
      depths_[i].relative_sigma = o.depth_sigma_in_world.norm() / (o.point_in_world - camera_in_world).norm();
    }
  }

  // One Gauss-Newton step of the pose with all depths eliminated; they are moved along. nullopt if it isn't finite.
  std::optional<Vector6d> Step(const Rigid3& camera_from_world, Matrix6d* information);
  // Sorts into inliers and outliers, each at the depth that suits it best; returns how many inliers.
  int Classify(const Rigid3& camera_from_world);

  std::vector<char>& is_inlier() { return is_inlier_; }
  double rms() const { return rms_; }

 private:
  struct Depth {
    double relative_sigma = 0.0;  // of the inverse depth
    double u = 0.0;
  };
  // Of one observation that takes part in a step: what gives u from the step of the pose.
  struct Eliminated {
    size_t observation;
    Vector6d coupling;
    double curvature;
    double gradient;
  };

  // point_i(u) - point_i, as a multiple of depth_sigma_i.
  static double Shift(const Depth& depth) { return depth.u / (1.0 + depth.u * depth.relative_sigma); }
  Eigen::Vector3d InCamera(const Eigen::Matrix3d& rotation, const Rigid3& camera_from_world, size_t i) const {
    const PoseObservation& o = observations_[i];
    return rotation * (o.point_in_world + Shift(depths_[i]) * o.depth_sigma_in_world) + camera_from_world.translation;
  }
  LinearTerm Linearize(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& point_in_camera, size_t i) const;
  void MoveDepth(size_t i, double step);
  double Bound(const Matrix6d& information) const;

  const PosePrior* prior_;  // nullptr: none
  const CameraCalibration& calibration_;
  double baseline_m_;
  std::span<const PoseObservation> observations_;
  std::vector<char> is_inlier_;
  std::vector<Depth> depths_;
  std::vector<Eliminated> eliminated_;
  // Of the last step, its observations alone: the inverse of their information about the translation; zero before it.
  Eigen::Matrix3d known_translation_ = Eigen::Matrix3d::Zero();
  double max_leverage_ = 1.0;
  double rms_ = 0.0;
};

// d(point)/du = R depth_sigma / (1 + u s)^2
LinearTerm PoseProblem::Linearize(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& point_in_camera,
                                  size_t i) const {
  const PoseObservation& o = observations_[i];
  LinearTerm term;
  term.reprojection = Reproject(calibration_, baseline_m_, point_in_camera, o.seen);
  const double stretch = 1.0 + depths_[i].u * depths_[i].relative_sigma;
  term.by_depth = term.reprojection.by_point * (rotation * o.depth_sigma_in_world) / (stretch * stretch);
  return term;
}

void PoseProblem::MoveDepth(size_t i, double step) {
  Depth& depth = depths_[i];
  if (depth.relative_sigma > 0.0) depth.u = std::max(depth.u + step, (kMinInverseRatio - 1.0) / depth.relative_sigma);
}

// The weight by which an observation of this information has no more than the greatest leverage: its share of what the
// last step knew of the translation, a mean over the axes.
double PoseProblem::Bound(const Matrix6d& information) const {
  const double leverage = known_translation_.cwiseProduct(information.topLeftCorner<3, 3>()).sum() / 3.0;
  return leverage > max_leverage_ ? max_leverage_ / leverage : 1.0;
}

std::optional<Vector6d> PoseProblem::Step(const Rigid3& camera_from_world, Matrix6d* information) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  NormalEquations equations;
  eliminated_.clear();
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Eigen::Vector3d point = InCamera(rotation, camera_from_world, i);
    if (!is_inlier_[i] || point.z() < kMinDepth) continue;
    const LinearTerm term = Linearize(rotation, point, i);
    const Eigen::Matrix<double, 3, 6> by_pose = ByPose(term.reprojection, point);
    const Eigen::Vector3d& residual = term.reprojection.residual;
    const double u = depths_[i].u;
    const double huber = HuberWeight(SquaredNorm(residual) + u * u, Chi2Limit(observations_[i].seen.has_right()));
    const Vector6d coupling = by_pose.transpose() * term.by_depth;
    const double curvature = 1.0 + term.by_depth.squaredNorm(), gradient = term.by_depth.dot(residual) + u;
    Matrix6d own = huber * (by_pose.transpose() * by_pose);
    own.noalias() -= (huber / curvature) * (coupling * coupling.transpose());
    const double bound = Bound(own);
    equations.information += bound * own;
    equations.gradient.noalias() +=
        (bound * huber) * (by_pose.transpose() * residual - (gradient / curvature) * coupling);
    eliminated_.push_back({i, coupling, curvature, gradient});
  }
  known_translation_ = equations.information.topLeftCorner<3, 3>().inverse();
  max_leverage_ = std::max(kMaxLeverage, 3.0 / static_cast<double>(eliminated_.size()));
  if (!known_translation_.allFinite()) return std::nullopt;
  if (prior_ != nullptr) {
    const Eigen::Vector3d center = (camera_from_world * prior_->camera_from_world.Inverse()).translation;
    equations.information.topLeftCorner<3, 3>() += prior_->information;
    equations.gradient.head<3>() += prior_->information * center;
  }
  *information = equations.information;
  const Vector6d step = equations.information.ldlt().solve(-equations.gradient);
  if (!step.allFinite()) return std::nullopt;
  for (const Eliminated& e : eliminated_) {
    MoveDepth(e.observation, -(e.gradient + e.coupling.dot(step)) / e.curvature);
  }
  return step;
}

int PoseProblem::Classify(const Rigid3& camera_from_world) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  int num_inliers = 0;
  double sum = 0.0;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const bool has_right = observations_[i].seen.has_right();
    is_inlier_[i] = 0;
    Eigen::Vector3d point = InCamera(rotation, camera_from_world, i);
    if (point.z() < kMinDepth) continue;
    const LinearTerm term = Linearize(rotation, point, i);
    MoveDepth(i, -(term.by_depth.dot(term.reprojection.residual) + depths_[i].u) / (1.0 + term.by_depth.squaredNorm()));
    point = InCamera(rotation, camera_from_world, i);
    if (point.z() < kMinDepth) continue;
    const double chi2 = SquaredNorm(ReprojectionResidual(calibration_, baseline_m_, point, observations_[i].seen)) +
                        depths_[i].u * depths_[i].u;
    if (chi2 > Chi2Limit(has_right)) continue;
    is_inlier_[i] = 1;
    ++num_inliers;
    sum += chi2 / (has_right ? 3.0 : 2.0);
  }
  rms_ = num_inliers > 0 ? std::sqrt(sum / num_inliers) : 0.0;
  return num_inliers;
}

}  // namespace

Eigen::Matrix3d TranslationCovariance(const Eigen::Matrix<double, 6, 6>& information) {
  // Schur's complement of the rotation.
  const Eigen::Matrix3d coupling = information.topRightCorner<3, 3>();
  const Eigen::Matrix3d rotation = information.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d alone =
      information.topLeftCorner<3, 3>() - coupling * rotation.inverse() * coupling.transpose();
  return alone.inverse();
}

PoseOptimizationResult OptimizePose(const CameraCalibration& calibration, double baseline_m,
                                    std::span<const PoseObservation> observations, const Rigid3& camera_from_world,
                                    const PoseOptimizationOptions& options, const PosePrior* prior) {
  PoseProblem problem(calibration, baseline_m, observations, camera_from_world, prior);
  PoseOptimizationResult result;
  result.camera_from_world = camera_from_world;
  for (int round = 0; round < options.num_rounds; ++round) {
    for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
      const std::optional<Vector6d> step = problem.Step(result.camera_from_world, &result.information);
      if (!step) break;
      result.camera_from_world = Retract(result.camera_from_world, *step);
      if (step->dot(result.information * *step) < options.min_step_sigmas * options.min_step_sigmas) break;
    }
    const std::vector<char> before = problem.is_inlier();
    result.num_inliers = problem.Classify(result.camera_from_world);
    if (result.num_inliers < kMinInliers || problem.is_inlier() == before) break;
  }
  result.rms = problem.rms();
  result.is_inlier = std::move(problem.is_inlier());
  if (result.num_inliers < kMinInliers) {
    result.camera_from_world = camera_from_world;
    result.num_inliers = 0;
    result.is_inlier.assign(observations.size(), 0);
  }
  return result;
}

}  // namespace tessera
