#include "optimization/right_image_estimation.h"

#include <cmath>
#include <utility>

#include "geometry/reprojection.h"
#include "optimization/lens_estimation.h"

namespace tessera {
namespace {

constexpr double kStep_px = 0.25;  // of the differences

// d RightShiftAt / d (center_px, across_px, down_px, bend_px)
Eigen::Vector4d ByShift(const CameraCalibration& camera, const Eigen::Vector2d& pixel) {
  const double half_width_px = 0.5 * camera.width_px;
  const double x = (pixel.x() - camera.cx_px) / half_width_px;
  return {1.0, x, (pixel.y() - camera.cy_px) / half_width_px, x * x};
}

// The problem at its least cost.
std::optional<BundleProblem> Solved(BundleProblem problem) {
  const std::optional<BundleResult> result = AdjustBundle(problem, LeastCostOptions());
  if (!result) return std::nullopt;
  for (size_t i = 0; i < problem.poses.size(); ++i) problem.poses[i].camera_from_world = result->camera_from_world[i];
  for (size_t i = 0; i < problem.points.size(); ++i) {
    problem.points[i].position_in_world = result->positions_in_world[i];
  }
  return problem;
}

// C': the third row of e is ((u - disparity) - right column) / sigma.
Eigen::Vector4d SlopeOf(const BundleProblem& problem) {
  Eigen::Vector4d slope = Eigen::Vector4d::Zero();
  for (const BundleObservation& observation : problem.observations) {
    if (!observation.seen.has_right()) continue;
    const Eigen::Vector3d in_camera = problem.poses[static_cast<size_t>(observation.pose)].camera_from_world *
                                      problem.points[static_cast<size_t>(observation.point)].position_in_world;
    if (in_camera.z() < kMinDepth) continue;
    const Eigen::Vector3d e =
        ReprojectionResidual(problem.calibration, problem.baseline_m, in_camera, observation.seen);
    const double weight = HuberWeight(e.squaredNorm(), Chi2Limit(true));
    slope -= weight * e.z() / observation.seen.sigma_px * ByShift(problem.calibration, observation.seen.pixel_px);
  }
  return slope;
}

}  // namespace

BundleProblem WithRightShift(BundleProblem problem, const RightShift& shift) {
  CameraCalibration further = problem.calibration;
  further.right_shift = shift;
  for (BundleObservation& observation : problem.observations) {
    observation.seen.right_x_px += RightShiftAt(further, observation.seen.pixel_px);
  }
  RightShift& total = problem.calibration.right_shift;
  total = {total.center_px + shift.center_px, total.across_px + shift.across_px, total.down_px + shift.down_px,
           total.bend_px + shift.bend_px};
  return problem;
}

std::optional<RightShiftEquations> EquationsOfRightShift(const BundleProblem& problem) {
  if (problem.points.empty()) return std::nullopt;
  const std::optional<BundleProblem> solved = Solved(problem);
  if (!solved) return std::nullopt;
  const Eigen::Vector4d slope = SlopeOf(*solved);
  Eigen::Matrix4d curvature;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector4d step = kStep_px * Eigen::Vector4d::Unit(k);
    const std::optional<BundleProblem> moved =
        Solved(WithRightShift(*solved, {step.x(), step.y(), step.z(), step.w()}));
    if (!moved) return std::nullopt;
    curvature.col(k) = (SlopeOf(*moved) - slope) / kStep_px;
  }
  if (!curvature.allFinite() || !slope.allFinite()) return std::nullopt;
  return RightShiftEquations{(curvature + curvature.transpose()) / (2.0 * kImagesVariance), -slope / kImagesVariance};
}

}  // namespace tessera
