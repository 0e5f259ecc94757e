// Decompositions of matrices larger than 4x4. Eigen's templates for them take a compiler several seconds, and each file
// that holds more expressions of Eigen more than in proportion, so they are compiled in decompositions.cc only.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace tessera {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

// Unit vector that `normal` shrinks most; of this symmetric matrix only the lower triangle is read. nullopt if a second
// vector is shrunk as much: then the measurements that `normal` sums up don't fix the vector.
std::optional<Vector9d> NullVector(const Matrix9d& normal);

// Inverse of a square matrix; not finite where it is singular.
Eigen::MatrixXd InverseOf(const Eigen::MatrixXd& matrix);

}  // namespace tessera
