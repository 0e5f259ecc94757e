// The bundle of a local window by Levenberg-Marquardt with a dense Schur complement, in fixed-size blocks. It ends at
// the minimum that Ceres finds (BundleSolver), in a fraction of the time (README.md).
// Only this module's sources include this file.
//
// With J the derivatives of all whitened residuals by the poses (c) and the points (p), a step solves
//
//   | U + D_c   W       | |d_c|     |g_c|      U = J_c' J_c,  V = J_p' J_p,  W = J_c' J_p,  g = J' r
//   | W'        V + D_p | |d_p| = - |g_p|      D = diag(J' J) / radius
//
// (the damping of points is turned into the direction of their ray, and they move by inverse depth along it: J. Civera,
// A. Davison, J. M. M. Montiel, "Inverse Depth Parametrization for Monocular SLAM", T-RO 2008)
//
// by the reduced system (U + D_c - W (V + D_p)^-1 W') d_c = -(g_c - W (V + D_p)^-1 g_p); V is block diagonal, 3 x 3.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "optimization/bundle_adjustment.h"
#include "optimization/bundle_summary.h"

namespace tessera {

class WindowSolver {
 public:
  // As BundleSolver.
  WindowSolver(const BundleProblem& problem, const BundleOptions& options);
  std::optional<BundleSummary> Solve(const std::vector<char>& takes_part);
  void WriteBack(BundleResult& result) const;

 private:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  using Matrix63d = Eigen::Matrix<double, 6, 3>;
  using Vector6d = Eigen::Matrix<double, 6, 1>;

  struct State {
    std::vector<Rigid3> poses;  // camera_from_world
    std::vector<Eigen::Matrix3d> rotations;
    std::vector<Eigen::Vector3d> positions;
  };
  // An observation that takes part.
  struct Term {
    size_t observation;
    size_t pose;
    int free_pose;  // its number among the free poses; -1: it is fixed
  };
  // The change that a step proposes.
  struct Step {
    std::vector<Vector6d> poses;          // by free pose
    std::vector<Eigen::Vector3d> points;  // by point
    double model_decrease = 0.0;          // of the cost, by the linearized residuals
  };

  void SelectTerms(const std::vector<char>& takes_part);
  double Cost(const State& state) const;
  void Linearize();
  template <int kRows>
  void LinearizeTerm(const Term& term, size_t point, Matrix63d& w);
  void LinearizeConstraints();
  void Reduce(double radius);
  std::optional<Step> SolveStep(double radius);
  Eigen::Vector3d RayTo(size_t point) const;
  Eigen::Matrix3d PointDamping(size_t point, double radius) const;
  Eigen::Vector3d MovedPoint(size_t point, const Eigen::Vector3d& step) const;
  Eigen::Vector3d BackSubstitute(size_t point, const std::vector<Vector6d>& poses) const;
  State Moved(const Step& step) const;
  Matrix6d& ReducedBlock(int row, int column) { return reduced_[static_cast<size_t>(row * (row + 1) / 2 + column)]; }

  const BundleProblem& problem_;
  const BundleOptions& options_;
  std::vector<int> free_of_pose_;  // by pose; -1: fixed
  std::vector<size_t> pose_of_free_;

  State state_;
  std::vector<Term> terms_;             // point after point
  std::vector<size_t> terms_of_point_;  // by point: its first term; one more at the end
  std::vector<size_t> ray_pose_of_point_;

  // The linearized problem.
  std::vector<Matrix6d> u_;
  std::vector<Vector6d> g_pose_;
  std::vector<Eigen::Matrix3d> v_;
  std::vector<Eigen::Vector3d> g_point_;
  std::vector<Matrix63d> w_;  // by term; only those of free poses are used
  struct ConstraintBlock {    // of two free poses, row > column
    int row;
    int column;
    Matrix6d value;
  };
  std::vector<ConstraintBlock> constraint_blocks_;

  // The reduced problem.
  std::vector<Eigen::Matrix3d> v_inverse_;
  std::vector<Eigen::Matrix3d> point_damping_;  // D_p, by point
  std::vector<Matrix6d> reduced_;               // lower triangle, row by row
  std::vector<Vector6d> reduced_gradient_;
};

}  // namespace tessera
