#include "optimization/bundle_solver.h"

#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>

#include "optimization/ceres_options.h"

namespace tessera {
namespace {

template <class Cost, class... Arguments>
void Append(std::vector<std::unique_ptr<ceres::CostFunction>>& costs, const Arguments&... arguments) {
  costs.push_back(std::make_unique<Cost>(arguments...));
}

}  // namespace

BundleSolver::BundleSolver(const BundleProblem& problem, const BundleOptions& options)
    : problem_(problem),
      options_(options),
      is_split_(problem.has_right()),
      block_size_(is_split_ ? 3 : 6),
      mono_loss_(std::sqrt(Chi2Limit(false))),
      stereo_loss_(std::sqrt(Chi2Limit(true))),
      tangents_(6 * problem.poses.size(), 0.0) {
  for (const BundlePoint& point : problem.points) {
    positions_.push_back(point.position_in_world);
  }
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    MovingPose pose;
    pose.base = problem.poses[i].camera_from_world;
    pose.tangent = Tangent(i);
    pose.Update();
    poses_.push_back(pose);
  }
  MakeCosts();
}

void BundleSolver::MakeCosts() {
  observation_costs_.reserve(problem_.observations.size());
  for (const BundleObservation& o : problem_.observations) {
    const MovingPose& pose = poses_[static_cast<size_t>(o.pose)];
    if (is_split_) {
      Append<StereoReprojectionCost, BundleProblem, PixelObservation>(observation_costs_, problem_, o.seen, pose);
    } else {
      Append<MonoReprojectionCost>(observation_costs_, problem_, o.seen, pose);
    }
  }
  for (const RelativePoseConstraint& c : problem_.constraints) {
    const MovingPose& from = poses_[static_cast<size_t>(c.from)];
    const MovingPose& to = poses_[static_cast<size_t>(c.to)];
    if (is_split_) {
      Append<SplitRelativePoseCost>(constraint_costs_, c, from, to);
    } else {
      Append<WholeRelativePoseCost>(constraint_costs_, c, from, to);
    }
  }
}

void BundleSolver::MarkUsed(const std::vector<char>& takes_part) {
  uses_pose_.assign(poses_.size(), 0);
  uses_point_.assign(positions_.size(), 0);
  for (size_t i = 0; i < takes_part.size(); ++i) {
    if (takes_part[i]) {
      uses_pose_[static_cast<size_t>(problem_.observations[i].pose)] = 1;
      uses_point_[static_cast<size_t>(problem_.observations[i].point)] = 1;
    }
  }
  for (const RelativePoseConstraint& c : problem_.constraints) {
    uses_pose_[static_cast<size_t>(c.from)] = 1;
    uses_pose_[static_cast<size_t>(c.to)] = 1;
  }
}

void BundleSolver::AddParameters(ceres::Problem& ceres_problem) {
  for (size_t i = 0; i < positions_.size(); ++i) {
    if (uses_point_[i]) {
      ceres_problem.AddParameterBlock(positions_[i].data(), 3);
    }
  }
  for (size_t i = 0; i < poses_.size(); ++i) {
    for (int offset = 0; uses_pose_[i] && offset < 6; offset += block_size_) {
      ceres_problem.AddParameterBlock(Tangent(i) + offset, block_size_);
      if (problem_.poses[i].is_fixed) {
        ceres_problem.SetParameterBlockConstant(Tangent(i) + offset);
      }
    }
  }
}

void BundleSolver::AddResiduals(const std::vector<char>& takes_part, ceres::Problem& ceres_problem) {
  for (size_t i = 0; i < takes_part.size(); ++i) {
    if (!takes_part[i]) {
      continue;
    }
    const BundleObservation& o = problem_.observations[i];
    ceres::LossFunction* loss = o.seen.has_right() ? &stereo_loss_ : &mono_loss_;
    double* position = positions_[static_cast<size_t>(o.point)].data();
    double* tangent = Tangent(static_cast<size_t>(o.pose));
    if (is_split_) {
      ceres_problem.AddResidualBlock(observation_costs_[i].get(), loss, position, tangent, tangent + 3);
    } else {
      ceres_problem.AddResidualBlock(observation_costs_[i].get(), loss, position, tangent);
    }
  }
  for (size_t i = 0; i < problem_.constraints.size(); ++i) {
    double* from = Tangent(static_cast<size_t>(problem_.constraints[i].from));
    double* to = Tangent(static_cast<size_t>(problem_.constraints[i].to));
    if (is_split_) {
      ceres_problem.AddResidualBlock(constraint_costs_[i].get(), nullptr, from, from + 3, to, to + 3);
    } else {
      ceres_problem.AddResidualBlock(constraint_costs_[i].get(), nullptr, from, to);
    }
  }
}

std::shared_ptr<ceres::ParameterBlockOrdering> BundleSolver::Ordering() {
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (size_t i = 0; i < positions_.size(); ++i) {
    if (uses_point_[i]) {
      ordering->AddElementToGroup(positions_[i].data(), 0);
    }
  }
  for (size_t i = 0; i < poses_.size(); ++i) {
    for (int offset = 0; uses_pose_[i] && offset < 6; offset += block_size_) {
      ordering->AddElementToGroup(Tangent(i) + offset, 1);
    }
  }
  return ordering;
}

std::optional<BundleSummary> BundleSolver::Solve(const std::vector<char>& takes_part, double function_tolerance) {
  MarkUsed(takes_part);
  int num_free_poses = 0;
  for (size_t i = 0; i < poses_.size(); ++i) {
    num_free_poses += uses_pose_[i] && !problem_.poses[i].is_fixed ? 1 : 0;
  }
  if (num_free_poses == 0 && std::count(uses_point_.begin(), uses_point_.end(), 1) == 0) {
    return std::nullopt;
  }
  PoseUpdater updater(poses_);
  ceres::Problem ceres_problem(CeresProblemOptions(updater));
  AddParameters(ceres_problem);
  AddResiduals(takes_part, ceres_problem);

  ceres::Solver::Options options = CeresSolverOptions(options_.max_num_iterations, function_tolerance);
  options.linear_solver_type =
      num_free_poses <= options_.max_num_dense_poses ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  options.linear_solver_ordering = Ordering();
  options.initial_trust_region_radius = options_.initial_radius;
  options.max_trust_region_radius = kMaxRadius;
  options.jacobi_scaling = false;  // the damping is scaled by the diagonal already
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  if (!summary.IsSolutionUsable()) {
    return std::nullopt;
  }
  return BundleSummary{summary.initial_cost, summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

void BundleSolver::WriteBack(BundleResult& result) const {
  result.positions_in_world = positions_;
  result.camera_from_world.resize(poses_.size());
  for (size_t i = 0; i < poses_.size(); ++i) {
    result.camera_from_world[i] = problem_.poses[i].is_fixed ? poses_[i].base : poses_[i].CameraFromWorld();
  }
}

}  // namespace tessera
