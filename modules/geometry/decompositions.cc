#include "geometry/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace tessera {

std::optional<Vector9d> NullVector(const Matrix9d& normal) {
  const Eigen::SelfAdjointEigenSolver<Matrix9d> solver(normal);
  const Vector9d& values = solver.eigenvalues();  // rising
  if (solver.info() != Eigen::Success || !(values(1) > 1e-12 * values(8))) {
    return std::nullopt;
  }
  return solver.eigenvectors().col(0);
}

Eigen::MatrixXd InverseOf(const Eigen::MatrixXd& matrix) { return matrix.inverse(); }

}  // namespace tessera
