// The reduced camera system of bundle adjustment: symmetric, positive definite, in blocks of 6 x 6, one a pair of poses
// that have a point (or a constraint) in common.
// Only this module's sources and its tests include this file.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

namespace tessera {

class ReducedSystem {
 public:
  using Block = Eigen::Matrix<double, 6, 6>;
  using Vector = Eigen::Matrix<double, 6, 1>;
  // Of the lower triangle: row >= column.
  struct Place {
    int row;
    int column;
    auto operator<=>(const Place&) const = default;
  };

  virtual ~ReducedSystem() = default;

  // All blocks zero.
  virtual void Clear() = 0;
  // Of the lower triangle; of diagonal blocks only the lower triangle is read.
  virtual Block& At(int row, int column) = 0;
  // Replaces `vectors` b by the solution x of A x = b. False, and `vectors` without meaning, if A is not positive
  // definite. A is without meaning afterwards.
  virtual bool Solve(std::span<Vector> vectors) = 0;
};

// All blocks may differ from zero: a local window.
std::unique_ptr<ReducedSystem> MakeDenseSystem(int num_poses);

// Only blocks at `places` (each once, the whole diagonal among them) may differ from zero: a large map. Poses are
// eliminated in SuiteSparse's order of approximate minimum degree (P. Amestoy, T. Davis, I. Duff, "An Approximate
// Minimum Degree Ordering Algorithm", 1996). That is a matter of integers; the factorization is ours, so that the bits
// of the solution depend on the matrix alone, not on a release of CHOLMOD or a BLAS (README.md).
std::unique_ptr<ReducedSystem> MakeSparseSystem(int num_poses, const std::vector<ReducedSystem::Place>& places);

}  // namespace tessera
