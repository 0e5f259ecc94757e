// Bundle adjustment by Levenberg-Marquardt with a Schur complement, in fixed-size blocks. It ends at the minimum that
// Ceres finds (BundleSolver), in a fraction of the time (README.md).
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
// The reduced system is dense for a local window and sparse for a large map (ReducedSystem).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "optimization/bundle_adjustment.h"
#include "optimization/bundle_summary.h"
#include "optimization/reduced_system.h"

namespace tessera {

class TrustRegion {
 public:
  explicit TrustRegion(double radius) : radius_(radius) {}

  double radius() const { return radius_; }
  // `gain`: of a step, the decrease of the cost as a share of what the model foresaw.
  void Accept(double gain, bool grows_fast);
  void Reject();

 private:
  double radius_;
  double shrink_ = 2.0;  // after the next rejected step
};

class SchurSolver {
 public:
  // As BundleSolver.
  SchurSolver(const BundleProblem& problem, const BundleOptions& options);
  std::optional<BundleSummary> Solve(const std::vector<char>& takes_part, double function_tolerance);
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

  // Steps that raise the cost for a moment.
  struct Climb {
    State from;
    double model_decrease = 0.0;  // of the first step, from there
    double height = 0.0;          // of the present state's cost
  };

  bool MayClimb(double height, double cost, const std::optional<Climb>& climb) const;
  void SelectTerms(const std::vector<char>& takes_part);
  double TwiceCostOf(size_t point, const State& state) const;
  double Cost(const State& state) const;
  void Linearize();
  template <int kRows>
  void LinearizeTerm(const Term& term, size_t point, Matrix63d& w);
  void LinearizeConstraints();
  void Reduce(double radius);
  std::optional<Step> SolveStep(double radius);
  Eigen::Vector3d RayTo(size_t point, const State& state) const;
  void RefinePoints(State& state) const;
  Eigen::Vector3d RefinedPoint(size_t point, const State& state) const;
  Eigen::Vector3d BackSubstitute(size_t point, const std::vector<Vector6d>& poses) const;
  State Moved(const Step& step) const;
  std::unique_ptr<ReducedSystem> MakeReducedSystem() const;

  const BundleProblem& problem_;
  const BundleOptions& options_;
  std::vector<int> free_of_pose_;  // by pose; -1: fixed
  std::vector<size_t> pose_of_free_;

  TrustRegion region_;
  State state_;
  std::vector<Term> terms_;             // point after point
  std::vector<size_t> terms_of_point_;  // by point: its first term; one more at the end
  std::vector<size_t> ray_pose_of_point_;

  // The linearized problem.
  std::vector<Matrix6d> u_;
  std::vector<Vector6d> g_pose_;
  std::vector<Eigen::Matrix3d> axes_;  // by point, in the world: those of its step
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
  std::vector<Eigen::Vector3d> point_damping_;  // D_p's diagonal, by point
  std::unique_ptr<ReducedSystem> reduced_;      // of the terms that take part
  std::vector<Vector6d> reduced_gradient_;
};

}  // namespace tessera
