#include "geometry/pose_optimization.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace tessera {
namespace {

constexpr int kMinInliers = 3;  // points that fix six degrees of freedom

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

struct NormalEquations {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

class PoseProblem {
 public:
  PoseProblem(const CameraCalibration& calibration, double baseline_m, std::span<const PoseObservation> observations)
      : calibration_(calibration),
        baseline_m_(baseline_m),
        observations_(observations),
        is_inlier_(observations.size(), 1) {}

  // Sorts into inliers and outliers; returns how many inliers.
  int Classify(const Rigid3& camera_from_world);
  NormalEquations Linearize(const Rigid3& camera_from_world, bool robust) const;

  std::vector<char>& is_inlier() { return is_inlier_; }
  double rms() const { return rms_; }

 private:
  const CameraCalibration& calibration_;
  double baseline_m_;
  std::span<const PoseObservation> observations_;
  std::vector<char> is_inlier_;
  double rms_ = 0.0;
};

int PoseProblem::Classify(const Rigid3& camera_from_world) {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  int num_inliers = 0;
  double sum = 0.0;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const PixelObservation& seen = observations_[i].seen;
    const Eigen::Vector3d point = rotation * observations_[i].point_in_world + camera_from_world.translation;
    is_inlier_[i] = 0;
    if (point.z() < kMinDepth) {
      continue;
    }
    const Eigen::Vector3d residual = ReprojectionResidual(calibration_, baseline_m_, point, seen);
    const double chi2 = residual.dot(residual);
    if (chi2 <= Chi2Limit(seen.has_right())) {
      is_inlier_[i] = 1;
      ++num_inliers;
      sum += chi2 / (seen.has_right() ? 3.0 : 2.0);
    }
  }
  rms_ = num_inliers > 0 ? std::sqrt(sum / num_inliers) : 0.0;
  return num_inliers;
}

NormalEquations PoseProblem::Linearize(const Rigid3& camera_from_world, bool robust) const {
  const Eigen::Matrix3d rotation = camera_from_world.rotation.toRotationMatrix();
  NormalEquations equations;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Eigen::Vector3d point = rotation * observations_[i].point_in_world + camera_from_world.translation;
    if (!is_inlier_[i] || point.z() < kMinDepth) {
      continue;
    }
    const Reprojection r = Reproject(calibration_, baseline_m_, point, observations_[i].seen);
    // d(point)/d(delta) = [I, -[point]x] for Retract's left perturbation.
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << r.by_point, -r.by_point * Skew(point);
    const double chi2 = r.residual.dot(r.residual);
    const double loss = robust ? HuberWeight(chi2, Chi2Limit(observations_[i].seen.has_right())) : 1.0;
    const Eigen::Matrix<double, 6, 3> weighted = loss * by_pose.transpose();
    equations.information.noalias() += weighted * by_pose;
    equations.gradient.noalias() += weighted * r.residual;
  }
  return equations;
}

}  // namespace

PoseOptimizationResult OptimizePose(const CameraCalibration& calibration, double baseline_m,
                                    std::span<const PoseObservation> observations, const Rigid3& camera_from_world,
                                    const PoseOptimizationOptions& options) {
  PoseProblem problem(calibration, baseline_m, observations);
  PoseOptimizationResult result;
  result.camera_from_world = camera_from_world;
  for (int round = 0; round < options.num_rounds; ++round) {
    for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
      const NormalEquations equations = problem.Linearize(result.camera_from_world, true);
      result.information = equations.information;
      const Vector6d step = equations.information.ldlt().solve(-equations.gradient);
      if (!step.allFinite()) {
        break;
      }
      result.camera_from_world = Retract(result.camera_from_world, step);
      if (step.norm() < options.min_step) {
        break;
      }
    }
    result.num_inliers = problem.Classify(result.camera_from_world);
    if (result.num_inliers < kMinInliers) {
      break;
    }
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
