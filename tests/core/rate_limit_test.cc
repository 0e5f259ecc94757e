#include "core/rate_limit.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// How many of `num_asked` are granted within a second, asked for at equal distances.
int NumGranted(RateLimit* limit, int num_asked, int64_t begin_us) {
  int num_granted = 0;
  for (int i = 0; i < num_asked; ++i) num_granted += limit->Take(1, begin_us + 1'000'000 * int64_t{i} / num_asked);
  return num_granted;
}

TEST(RateLimit, WhatIsRareIsNotHeldUp) {
  RateLimit limit(100, 10);
  EXPECT_EQ(NumGranted(&limit, 99, 0), 99);
  EXPECT_EQ(NumGranted(&limit, 99, 1'000'000), 99);
}

TEST(RateLimit, AFloodGetsNoMoreThanTheRate) {
  RateLimit limit(100, 10);
  EXPECT_LE(NumGranted(&limit, 50'000, 0), 110);
  EXPECT_NEAR(NumGranted(&limit, 50'000, 1'000'000), 100, 1);
}

TEST(RateLimit, ABurstIsGrantedAfterAPause) {
  RateLimit limit(100, 10);
  for (const int64_t now_us : {int64_t{0}, int64_t{10'000'000}}) {
    for (int i = 0; i < 10; ++i) EXPECT_TRUE(limit.Take(1, now_us));
    EXPECT_FALSE(limit.Take(1, now_us));
  }
}

TEST(RateLimit, MoreThanABurstWaitsForAllOfIt) {
  RateLimit limit(100, 10);
  EXPECT_TRUE(limit.Take(50, 0));
  EXPECT_FALSE(limit.Take(1, 300'000)) << "it is paid for afterwards";
  EXPECT_TRUE(limit.Take(1, 500'000));
}

TEST(RateLimit, TimeThatStandsStillGivesNothing) {
  RateLimit limit(100, 1);
  EXPECT_TRUE(limit.Take(1, 1000));
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(limit.Take(1, 1000));
}

}  // namespace
}  // namespace tessera
