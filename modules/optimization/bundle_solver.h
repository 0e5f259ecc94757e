// Builds the Ceres problem of a bundle, solves it, and writes the state back. Only this
// module's sources include this file.
#pragma once

#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>

#include <memory>
#include <optional>
#include <vector>

#include "optimization/bundle_adjustment.h"
#include "optimization/bundle_costs.h"
#include "optimization/bundle_summary.h"

namespace tessera {

class BundleSolver {
 public:
  // Both must outlive the solver; problem and options must be well formed, and the problem finite.
  BundleSolver(const BundleProblem& problem, const BundleOptions& options);

  // One robust least-squares solve over the constraints and the observations with takes_part[i] != 0, from where the
  // last one ended. It ends when a step lowers the cost by less than `function_tolerance` of it. nullopt: nothing free
  // takes part, or Ceres failed; the state is then unspecified.
  std::optional<BundleSummary> Solve(const std::vector<char>& takes_part, double function_tolerance);

  // The poses and points as they are now.
  void WriteBack(BundleResult& result) const;

 private:
  void MakeCosts();
  // Which poses and points the residuals that take part move.
  void MarkUsed(const std::vector<char>& takes_part);
  void AddParameters(ceres::Problem& ceres_problem);
  void AddResiduals(const std::vector<char>& takes_part, ceres::Problem& ceres_problem);
  // Points first, to be eliminated; then poses. Given, so that Ceres need not search for one.
  std::shared_ptr<ceres::ParameterBlockOrdering> Ordering();

  double* Tangent(size_t pose) { return tangents_.data() + 6 * pose; }

  const BundleProblem& problem_;
  const BundleOptions& options_;
  bool is_split_;  // pose tangents are two blocks of three, for the three rows of a right column; else one of six
  int block_size_;
  ceres::HuberLoss mono_loss_;
  ceres::HuberLoss stereo_loss_;

  // Parameters lie in arrays in the order of the problem: Ceres orders the blocks of a group by address.
  std::vector<double> tangents_;            // 6 a pose
  std::vector<Eigen::Vector3d> positions_;  // by point
  std::vector<MovingPose> poses_;
  std::vector<char> uses_pose_;
  std::vector<char> uses_point_;

  std::vector<std::unique_ptr<ceres::CostFunction>> observation_costs_;
  std::vector<std::unique_ptr<ceres::CostFunction>> constraint_costs_;
};

}  // namespace tessera
