#include "datasets/capture_clock.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kPeriodUs = 100'000;

TEST(CaptureClock, TheHostsOwnStampsAreKept) {
  CaptureClock clock(true);
  EXPECT_EQ(clock.CapturedUs(5'000'000, 5'030'000), 5'000'000);
  EXPECT_EQ(clock.CapturedUs(5'100'000, 5'190'000), 5'100'000);
}

TEST(CaptureClock, AStreamIsMappedByItsFastestImages) {
  CaptureClock clock(false);
  const int64_t offset_us = 700'000'000;
  // Images take 20 ms, every third one 80 ms.
  for (int64_t k = 0; k < 50; ++k) {
    const int64_t stamp_us = kPeriodUs * k, delay_us = k % 3 == 2 ? 80'000 : 20'000;
    EXPECT_EQ(clock.CapturedUs(stamp_us, stamp_us + offset_us + delay_us), stamp_us + offset_us + 20'000) << k;
  }
}

TEST(CaptureClock, ADriftingClockIsFollowed) {
  CaptureClock clock(false);
  int64_t captured_us = 0;
  for (int64_t k = 0; k < 20'000; ++k) captured_us = clock.CapturedUs(kPeriodUs * k, kPeriodUs * k + k);  // 10 ppm
  EXPECT_NEAR(static_cast<double>(captured_us), static_cast<double>(19'999 * kPeriodUs + 19'999), 101.0);
}

TEST(CaptureClock, AStreamThatBeginsAnewIsMappedAnew) {
  CaptureClock clock(false);
  EXPECT_EQ(clock.CapturedUs(60'000'000, 100'000'000), 100'000'000);
  EXPECT_EQ(clock.CapturedUs(0, 108'000'000), 108'000'000) << "the server counts from 0 again";
  EXPECT_EQ(clock.CapturedUs(kPeriodUs, 108'150'000), 108'100'000);
}

TEST(CaptureClock, WithoutStampsItIsTheArrivalThatCounts) {
  CaptureClock clock(false);
  for (int64_t k = 1; k < 20; ++k) EXPECT_EQ(clock.CapturedUs(0, kPeriodUs * k), kPeriodUs * k);
}

TEST(CaptureClock, TimeGoesOn) {
  CaptureClock clock(false);
  const int64_t first_us = clock.CapturedUs(0, 2'000);
  EXPECT_GT(clock.CapturedUs(0, 2'000), first_us);
}

TEST(CaptureClock, AlsoAfterAShortWhile) {
  CaptureClock clock(false);
  EXPECT_EQ(clock.CapturedUs(20'000, 1'000'000), 1'000'000);
  EXPECT_EQ(clock.CapturedUs(100'000, 1'080'000), 1'080'000);
  // The camera was away for a second, and counts from its start again.
  EXPECT_EQ(clock.CapturedUs(20'000, 2'100'000), 2'100'000);
}

}  // namespace
}  // namespace tessera
