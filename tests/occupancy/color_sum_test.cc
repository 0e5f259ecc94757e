#include "occupancy/color_sum.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(ColorSum, WhatIsTakenOutLeavesNoTrace) {
  constexpr Rgb kOne{200, 10, 255}, kOther{101, 3, 0};
  ColorSum sum;
  sum.Add(kOne);
  sum.Add(kOther);
  EXPECT_EQ(sum.Mean(2), (Rgb{150, 6, 127}));
  sum.Add(kOne, -1);
  EXPECT_EQ(sum.Mean(1), kOther);
}

}  // namespace
}  // namespace tessera
