// The sparse Cholesky factorization of all large problems.
#pragma once

#include <ceres/types.h>

namespace tessera {

// Eigen's, whose order of summation depends on the matrix alone. CHOLMOD leaves large blocks to the installed BLAS, and
// some of these (ATLAS) sum in another order depending on the memory alignment of a block, which changes the result of
// a run.
inline constexpr ceres::SparseLinearAlgebraLibraryType kSparseLibrary = ceres::EIGEN_SPARSE;

}  // namespace tessera
