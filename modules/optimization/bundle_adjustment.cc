#include "optimization/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "optimization/bundle_costs.h"
#include "optimization/bundle_solver.h"
#include "optimization/schur_solver.h"

namespace tessera {
namespace {

// Of rounds before the last, where slow modes are left to that one.
constexpr double kCoarseTolerance = 1e-3;

bool IsIndex(int index, size_t size) { return index >= 0 && static_cast<size_t>(index) < size; }

bool IsFinite(const Rigid3& pose) { return pose.rotation.coeffs().allFinite() && pose.translation.allFinite(); }

bool IsFinite(const BundleProblem& problem) {
  return std::all_of(problem.poses.begin(), problem.poses.end(),
                     [](const BundlePose& pose) { return IsFinite(pose.camera_from_world); }) &&
         std::all_of(problem.points.begin(), problem.points.end(),
                     [](const BundlePoint& point) { return point.position_in_world.allFinite(); }) &&
         std::all_of(problem.observations.begin(), problem.observations.end(),
                     [](const BundleObservation& o) {
                       return o.seen.pixel_px.allFinite() && (!o.seen.has_right() || std::isfinite(o.seen.right_x_px));
                     }) &&
         std::all_of(problem.constraints.begin(), problem.constraints.end(),
                     [](const RelativePoseConstraint& c) { return IsFinite(c.to_from_from); });
}

bool IsFinite(const BundleResult& result) {
  return std::isfinite(result.final_cost) &&
         std::all_of(result.camera_from_world.begin(), result.camera_from_world.end(),
                     [](const Rigid3& pose) { return IsFinite(pose); }) &&
         std::all_of(result.positions_in_world.begin(), result.positions_in_world.end(),
                     [](const Eigen::Vector3d& position) { return position.allFinite(); });
}

// Chi-square test of all observations at the poses and points of `result`.
std::vector<char> Classify(const BundleProblem& problem, const BundleResult& result) {
  std::vector<Eigen::Matrix3d> rotations;
  for (const Rigid3& pose : result.camera_from_world) {
    rotations.push_back(pose.rotation.toRotationMatrix());
  }
  std::vector<char> is_inlier(problem.observations.size(), 0);
  for (size_t i = 0; i < is_inlier.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const auto pose = static_cast<size_t>(o.pose), point = static_cast<size_t>(o.point);
    const Eigen::Vector3d point_in_camera =
        rotations[pose] * result.positions_in_world[point] + result.camera_from_world[pose].translation;
    if (point_in_camera.z() >= kMinDepth) {
      const Eigen::Vector3d residual =
          ReprojectionResidual(problem.calibration, problem.baseline_m, point_in_camera, o.seen);
      is_inlier[i] = SquaredNorm(residual) <= Chi2Limit(o.seen.has_right()) ? 1 : 0;
    }
  }
  return is_inlier;
}

// Before the first round outliers are unknown; only points behind the camera are excluded.
std::vector<char> InFront(const BundleProblem& problem) {
  std::vector<char> is_in_front(problem.observations.size(), 0);
  for (size_t i = 0; i < is_in_front.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const Eigen::Vector3d point_in_camera = problem.poses[static_cast<size_t>(o.pose)].camera_from_world *
                                            problem.points[static_cast<size_t>(o.point)].position_in_world;
    is_in_front[i] = point_in_camera.z() >= kMinDepth ? 1 : 0;
  }
  return is_in_front;
}

// Mono: scales the world about the fixed camera's center until `scale_pose` is as far from it as it was. No pixel
// moves.
void RestoreScale(const BundleProblem& problem, BundleResult& result) {
  const auto fixed =
      std::find_if(problem.poses.begin(), problem.poses.end(), [](const BundlePose& pose) { return pose.is_fixed; });
  const Eigen::Vector3d origin = fixed->camera_from_world.Inverse().translation;
  const auto scaled = static_cast<size_t>(problem.scale_pose);
  const double before = (problem.poses[scaled].camera_from_world.Inverse().translation - origin).norm();
  const double after = (result.camera_from_world[scaled].Inverse().translation - origin).norm();
  const double scale = before / after;
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    if (!problem.poses[i].is_fixed) {
      Rigid3& pose = result.camera_from_world[i];
      const Eigen::Vector3d center = origin + scale * (pose.Inverse().translation - origin);
      pose.translation = -(pose.rotation * center);
    }
  }
  for (Eigen::Vector3d& position : result.positions_in_world) {
    position = origin + scale * (position - origin);
  }
}

Result<> CheckObservations(const BundleProblem& problem) {
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const BundleObservation& o = problem.observations[i];
    const auto name = [i] { return "observation " + std::to_string(i); };
    if (!IsIndex(o.pose, problem.poses.size()) || !IsIndex(o.point, problem.points.size())) {
      return Failed(name() + " names pose " + std::to_string(o.pose) + " and point " + std::to_string(o.point) +
                    ", and one of them is not in the problem");
    }
    if (!(o.seen.sigma_px > 0.0)) {
      return Failed(name() + " has a sigma_px that is not positive");
    }
    if (o.seen.has_right() && !(problem.baseline_m > 0.0)) {
      return Failed(name() + " has a right column, but baseline_m is not positive");
    }
  }
  return {};
}

Result<> CheckConstraints(const BundleProblem& problem) {
  for (size_t i = 0; i < problem.constraints.size(); ++i) {
    const RelativePoseConstraint& c = problem.constraints[i];
    const std::string name = "constraint " + std::to_string(i);
    if (!IsIndex(c.from, problem.poses.size()) || !IsIndex(c.to, problem.poses.size()) || c.from == c.to) {
      return Failed(name + " must name two different poses of the problem");
    }
    if (c.information.llt().info() != Eigen::Success) {
      return Failed(name + " has an information matrix that is not positive definite");
    }
  }
  return {};
}

Result<> CheckGauge(const BundleProblem& problem) {
  const int num_fixed = problem.num_fixed_poses();
  if (num_fixed == 0) {
    return Failed("no pose is fixed; fix one at least (gauge)");
  }
  if (problem.scale_pose == -1) {
    return {};
  }
  if (!IsIndex(problem.scale_pose, problem.poses.size()) ||
      problem.poses[static_cast<size_t>(problem.scale_pose)].is_fixed) {
    return Failed("scale_pose must be the index of a free pose, or -1");
  }
  if (num_fixed > 1 || problem.has_right()) {
    return Failed("scale_pose is for mono with one fixed pose; all else fixes the scale, so set it to -1");
  }
  return {};
}

// Solves in rounds, each with the observations that the one before found to agree.
template <class Solver>
std::optional<BundleResult> AdjustInRounds(const BundleProblem& problem, const BundleOptions& options) {
  Solver solver(problem, options);
  BundleResult result;
  std::vector<char> takes_part = InFront(problem);
  for (int round = 0; round < options.num_rounds; ++round) {
    const bool is_coarse = options.has_slow_modes && round + 1 < options.num_rounds;
    const std::optional<BundleSummary> summary =
        solver.Solve(takes_part, is_coarse ? kCoarseTolerance : options.function_tolerance);
    if (!summary) {
      return std::nullopt;
    }
    result.initial_cost = round == 0 ? summary->initial_cost : result.initial_cost;
    result.final_cost = summary->final_cost;
    result.num_iterations += summary->num_iterations;
    solver.WriteBack(result);
    result.is_inlier = Classify(problem, result);
    if (result.is_inlier == takes_part && !is_coarse) {
      break;
    }
    takes_part = result.is_inlier;
  }
  return result;
}

}  // namespace

int BundleProblem::num_fixed_poses() const {
  return static_cast<int>(
      std::count_if(poses.begin(), poses.end(), [](const BundlePose& pose) { return pose.is_fixed; }));
}

bool BundleProblem::has_right() const {
  return std::any_of(observations.begin(), observations.end(),
                     [](const BundleObservation& o) { return o.seen.has_right(); });
}

Result<> BundleProblem::Check() const {
  if (!(calibration.fx_px > 0.0) || !(calibration.fy_px > 0.0)) {
    return Failed("the calibration's focal lengths must be positive");
  }
  TESSERA_RETURN_IF_FAILED(CheckObservations(*this));
  TESSERA_RETURN_IF_FAILED(CheckConstraints(*this));
  return CheckGauge(*this);
}

Result<> BundleOptions::Check() const {
  if (max_num_iterations < 1 || num_rounds < 1) {
    return Failed("bundle adjustment needs at least one iteration and one round");
  }
  if (!(initial_radius > 0.0) || !(initial_radius <= kMaxRadius)) {
    return Failed("initial_radius must be positive and at most 1e10");
  }
  if (!(function_tolerance >= 0.0) || max_num_dense_poses < 0) {
    return Failed("function_tolerance and max_num_dense_poses must not be negative");
  }
  return {};
}

BundleOptions GlobalBundleOptions() {
  return {.max_num_iterations = 20,
          .num_rounds = 2,
          .function_tolerance = 1e-7,
          .initial_radius = 1e5,
          .has_slow_modes = true};
}

std::optional<BundleResult> AdjustBundle(const BundleProblem& problem, const BundleOptions& options) {
  ThrowIfFailed<std::invalid_argument>(problem.Check(), "AdjustBundle: ");
  ThrowIfFailed<std::invalid_argument>(options.Check(), "AdjustBundle: ");
  if (!IsFinite(problem)) {
    return std::nullopt;
  }
  std::optional<BundleResult> result = options.is_always_ceres ? AdjustInRounds<BundleSolver>(problem, options)
                                                               : AdjustInRounds<SchurSolver>(problem, options);
  if (!result) {
    return std::nullopt;
  }
  if (problem.scale_pose >= 0) {
    RestoreScale(problem, *result);
  }
  result->num_inliers = static_cast<int>(std::count(result->is_inlier.begin(), result->is_inlier.end(), 1));
  return IsFinite(*result) ? result : std::nullopt;
}

}  // namespace tessera
