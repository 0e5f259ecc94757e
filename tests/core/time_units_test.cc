#include "core/time_units.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(TimeUnits, MicrosecondsAreSeconds) {
  EXPECT_EQ(SecondsOf(0), 0.0);
  EXPECT_EQ(SecondsOf(1'500'000), 1.5);
  EXPECT_EQ(SecondsOf(-250'000), -0.25);
}

// A span of two host times is exact to less than a microsecond, whatever the times themselves are.
TEST(TimeUnits, SpansAreExactWhereverTheyLie) {
  const int64_t now_us = 1'790'000'000'000'000;
  EXPECT_NEAR(SecondsOf((now_us + 33'333) - now_us), 0.033333, 1e-12);
}

}  // namespace
}  // namespace tessera
