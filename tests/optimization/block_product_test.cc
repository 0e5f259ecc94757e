#include "optimization/block_product.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera {
namespace {

template <int kDepth>
Eigen::Matrix<double, 6, kDepth> Random(std::mt19937& generator) {
  std::normal_distribution<double> normal;
  return Eigen::Matrix<double, 6, kDepth>::NullaryExpr([&] { return normal(generator); });
}

// Results do not depend on which of the two ways a processor goes.
template <int kDepth>
void ExpectEigensBits() {
  std::mt19937 generator(kDepth);
  for (int i = 0; i < 200; ++i) {
    const auto a = Random<kDepth>(generator), b = Random<kDepth>(generator);
    const auto before = Random<6>(generator);
    Eigen::Matrix<double, 6, 6> sum = before, difference = before, expected_sum = before, expected_difference = before;
    AddProduct<1>(a, b, sum);
    AddProduct<-1>(a, b, difference);
    expected_sum.noalias() += a.lazyProduct(b.transpose());
    expected_difference.noalias() -= a.lazyProduct(b.transpose());
    ASSERT_EQ(sum, expected_sum);
    ASSERT_EQ(difference, expected_difference);
  }
}

TEST(BlockProduct, HasTheBitsOfEigensProductOfTwoColumns) { ExpectEigensBits<2>(); }

TEST(BlockProduct, HasTheBitsOfEigensProductOfThreeColumns) { ExpectEigensBits<3>(); }

}  // namespace
}  // namespace tessera
