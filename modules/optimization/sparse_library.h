// The sparse Cholesky factorization of all large problems.
#pragma once

#include <ceres/types.h>

namespace tessera {

// Eigen's, which adds up in the order of the matrix alone. CHOLMOD leaves large blocks to the BLAS of the machine;
// ATLAS, for one, takes another way through a product where a block lies differently in memory, and with it the run
// another result.
inline constexpr ceres::SparseLinearAlgebraLibraryType kSparseLibrary = ceres::EIGEN_SPARSE;

}  // namespace tessera
