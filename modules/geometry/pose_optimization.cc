#include "geometry/pose_optimization.h"

#include <Eigen/LU>
#include <optional>

#include "geometry/pose_problem.h"

namespace tessera {
namespace {

constexpr int kMinInliers = 3;  // points that fix six degrees of freedom

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
      const std::optional<Eigen::Matrix<double, 6, 1>> step =
          problem.Step(result.camera_from_world, &result.information);
      if (!step) break;
      result.camera_from_world = Retract(result.camera_from_world, *step);
      if (step->dot(result.information * *step) < options.min_step_sigmas * options.min_step_sigmas) break;
    }
    const std::vector<char> before = problem.is_inlier();
    result.num_inliers = problem.Classify(result.camera_from_world);
    if (result.num_inliers < kMinInliers || problem.is_inlier() == before) break;
  }
  result.rms = problem.rms();
  result.is_inlier = problem.is_inlier();
  if (result.num_inliers < kMinInliers) {
    result.camera_from_world = camera_from_world;
    result.num_inliers = 0;
    result.is_inlier.assign(observations.size(), 0);
  }
  return result;
}

}  // namespace tessera
