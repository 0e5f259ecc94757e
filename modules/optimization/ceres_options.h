// What all solves in Ceres have in common: their results are functions of the problem alone. Only this module's sources
// include this file.
#pragma once

#include <ceres/problem.h>
#include <ceres/solver.h>

namespace tessera {

// Costs, losses and `callback` belong to the caller and must outlive the problem, which the caller has checked.
inline ceres::Problem::Options CeresProblemOptions(ceres::EvaluationCallback& callback) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.evaluation_callback = &callback;
  options.disable_all_safety_checks = true;
  return options;
}

// One thread, and bounds on iterations instead of time: results must not depend on the load of the machine. Sparse
// systems are solved by Eigen, whose order of summation depends on the matrix alone. CHOLMOD leaves large blocks to the
// installed BLAS, and some of these (ATLAS) sum in another order depending on the memory alignment of a block.
inline ceres::Solver::Options CeresSolverOptions(int max_num_iterations, double function_tolerance) {
  ceres::Solver::Options options;
  options.max_num_iterations = max_num_iterations;
  options.function_tolerance = function_tolerance;
  options.max_solver_time_in_seconds = 1e9;
  options.num_threads = 1;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.logging_type = ceres::SILENT;
  return options;
}

}  // namespace tessera
