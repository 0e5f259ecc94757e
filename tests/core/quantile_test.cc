#include "core/quantile.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(Quantile, IsTheValueAtItsRank) {
  const std::vector<float> values = {0.0F, 1.0F, 2.0F, 3.0F, 4.0F};
  EXPECT_EQ(Quantile(values, 0.0), 0.0);
  EXPECT_EQ(Quantile(values, 0.5), 2.0);
  EXPECT_EQ(Quantile(values, 1.0), 4.0);
}

TEST(Quantile, InterpolatesBetweenValues) {
  const std::vector<double> values = {1.0, 4.0};
  EXPECT_DOUBLE_EQ(Quantile(values, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(Quantile(values, 0.95), 3.85);
}

TEST(Quantile, OfOneValueIsThatValue) { EXPECT_EQ(Quantile(std::vector<double>{7.0}, 0.99), 7.0); }

}  // namespace
}  // namespace tessera
