// The products that the Schur solver spends its time on, four numbers at a time where the processor can: Eigen takes
// two, since six rows are no multiple of four. Both give the same bits: each number is a fused sum of its products,
// from the first to the last.
#pragma once

#include <Eigen/Core>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

namespace tessera {

// block += a b'  or, for kSign = -1,  block -= a b'
// Always inline, so that a loop over `b` reads `a` once.
template <int kSign, int kDepth>
[[gnu::always_inline]] inline void AddProduct(const Eigen::Matrix<double, 6, kDepth>& a,
                                              const Eigen::Matrix<double, 6, kDepth>& b,
                                              Eigen::Matrix<double, 6, 6>& block) {
  static_assert(kSign == 1 || kSign == -1);
#if defined(__AVX2__) && defined(__FMA__)
  // Two columns of the block are three packs: rows 0-3 of the first, its rows 4-5 with 0-1 of the second, whose rows
  // 2-5 are the third. `rows` are those of a column of `a`, `factors` what they are multiplied by.
  __m256d rows[3][kDepth];
  for (int k = 0; k < kDepth; ++k) {
    const double* column = a.data() + 6 * k;
    rows[0][k] = _mm256_loadu_pd(column);
    rows[1][k] = _mm256_set_m128d(_mm_loadu_pd(column), _mm_loadu_pd(column + 4));
    rows[2][k] = _mm256_loadu_pd(column + 2);
  }
  for (int j = 0; j < 6; j += 2) {
    __m256d sums[3];
    for (int k = 0; k < kDepth; ++k) {
      const __m256d first = _mm256_broadcast_sd(b.data() + 6 * k + j);
      const __m256d second = _mm256_broadcast_sd(b.data() + 6 * k + j + 1);
      const __m256d factors[3] = {first, _mm256_blend_pd(first, second, 0b1100), second};
      for (int i = 0; i < 3; ++i) {
        sums[i] = k == 0 ? _mm256_mul_pd(rows[i][k], factors[i]) : _mm256_fmadd_pd(rows[i][k], factors[i], sums[i]);
      }
    }
    double* columns = block.data() + 6 * j;
    for (int i = 0; i < 3; ++i) {
      const __m256d before = _mm256_loadu_pd(columns + 4 * i);
      _mm256_storeu_pd(columns + 4 * i, kSign > 0 ? _mm256_add_pd(before, sums[i]) : _mm256_sub_pd(before, sums[i]));
    }
  }
#else
  if constexpr (kSign > 0) {
    block.noalias() += a.lazyProduct(b.transpose());
  } else {
    block.noalias() -= a.lazyProduct(b.transpose());
  }
#endif
}

}  // namespace tessera
