// Random numbers that are functions of their arguments.
#include "simulation/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace tessera {
namespace {

TEST(HashOf, DependsOnEveryArgumentAndTheirOrder) {
  const std::set<uint32_t> hashes{HashOf(1, 2, 3, 4), HashOf(2, 1, 3, 4), HashOf(1, 3, 2, 4), HashOf(1, 2, 4, 3),
                                  HashOf(0, 2, 3, 4), HashOf(1, 0, 3, 4), HashOf(1, 2, 0, 4), HashOf(1, 2, 3, 0)};
  EXPECT_EQ(hashes.size(), 8U);
}

TEST(Random, IsUniformWithinItsLimitsAndRepeats) {
  Random a(5), b(5);
  double sum = 0.0;
  int counts[4] = {};
  for (int i = 0; i < 4000; ++i) {
    const double x = a.Uniform(-1.0, 3.0);
    ASSERT_EQ(x, b.Uniform(-1.0, 3.0));
    ASSERT_TRUE(x >= -1.0 && x < 3.0);
    sum += x;
    const int index = a.Index(4);
    ASSERT_EQ(index, b.Index(4));
    ++counts[index];
  }
  EXPECT_NEAR(sum / 4000, 1.0, 0.06);
  for (const int count : counts) EXPECT_NEAR(count, 1000, 100);
}

TEST(Noise, IsSmoothAndBounded) {
  for (int i = 0; i < 1000; ++i) {
    const double x = 0.037 * i;
    EXPECT_LE(std::abs(SmoothNoise(3, x)), 1.0);
    EXPECT_NEAR(SmoothNoise(3, x), SmoothNoise(3, x + 1e-6), 1e-4);
    const auto u = static_cast<float>(x);
    const float plane = PlaneNoise(3, u, 2.0F * u), fractal = FractalNoise(3, u, 2.0F * u, 4);
    EXPECT_TRUE(plane >= 0.0F && plane <= 1.0F);
    EXPECT_TRUE(fractal >= 0.0F && fractal <= 1.0F);
  }
}

}  // namespace
}  // namespace tessera
