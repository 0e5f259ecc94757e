#include "features/stereo_matcher.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/wave_image.h"

namespace tessera {
namespace {

constexpr int kWidth = 400, kHeight = 200, kMaxDisparity = 40;

LevelImage Whole(const GrayImage& image) {
  LevelImage whole;
  CopyRegion(image, {0, 0, image.width, image.height}, {0, 0, image.width, image.height}, whole);
  return whole;
}

struct Errors {
  int num = 0;
  double mean_px = 0.0;
  double rms_px = 0.0;
};

// Of the disparities of pixels all over the image.
Errors ErrorsOf(const GrayImage& left, const GrayImage& right, double disparity_px) {
  const LevelImage whole_left = Whole(left), whole_right = Whole(right);
  StereoMatcher matcher;
  Errors errors;
  double sum = 0.0, squares = 0.0;
  for (int y = 30; y < kHeight - 30; y += 9) {
    for (int x = 80; x < kWidth - 30; x += 7) {
      const auto match = matcher.Match(whole_left, whole_right, x, y, y, kMaxDisparity);
      if (!match) continue;
      const double error = x - static_cast<double>(match->position) / StereoMatcher::kSubpixels - disparity_px;
      sum += error;
      squares += error * error;
      ++errors.num;
    }
  }
  errors.mean_px = sum / errors.num;
  errors.rms_px = std::sqrt(squares / errors.num);
  return errors;
}

class StereoMatcherTest : public testing::TestWithParam<double> {};

// Whole positions do not attract: one disparity is as good as another.
TEST_P(StereoMatcherTest, FindsDisparitiesBetweenPixels) {
  const double disparity_px = GetParam();
  const Errors errors = ErrorsOf(WaveImage(kWidth, kHeight), WaveImage(kWidth, kHeight, disparity_px), disparity_px);
  EXPECT_GE(errors.num, 300);
  EXPECT_LT(std::abs(errors.mean_px), 0.015);
  EXPECT_LT(errors.rms_px, 0.04);
}

TEST_P(StereoMatcherTest, WhateverTheBrightness) {
  const double disparity_px = GetParam();
  const Errors errors =
      ErrorsOf(WaveImage(kWidth, kHeight), WaveImage(kWidth, kHeight, disparity_px, 0.0, 0.95), disparity_px);
  EXPECT_GE(errors.num, 250);
  EXPECT_LT(std::abs(errors.mean_px), 0.05);
}

INSTANTIATE_TEST_SUITE_P(Px, StereoMatcherTest, testing::Values(0.0, 3.0, 7.2, 7.35, 7.5, 7.65, 12.8, 39.3));

TEST(StereoMatcherLimits, WhatIsNearerThanIsSearchedHasNoMatch) {
  for (const double disparity_px : {41.6, 42.5}) {
    const LevelImage left = Whole(WaveImage(kWidth, kHeight)), right = Whole(WaveImage(kWidth, kHeight, disparity_px));
    StereoMatcher matcher;
    for (int y = 30; y < kHeight - 30; y += 9) {
      for (int x = 80; x < kWidth - 30; x += 7) {
        const auto match = matcher.Match(left, right, x, y, y, kMaxDisparity);
        if (!match) continue;
        EXPECT_GE(match->position, (x - kMaxDisparity - 1) * StereoMatcher::kSubpixels) << x << " " << y;
      }
    }
  }
}

TEST(StereoMatcherLimits, WhatIsSeenToTheRightIsInfinitelyFar) {
  // A pair that squints a little: disparities of far things are negative.
  const LevelImage left = Whole(WaveImage(kWidth, kHeight)), right = Whole(WaveImage(kWidth, kHeight, -0.3));
  StereoMatcher matcher;
  int num = 0;
  for (int x = 80; x < kWidth - 30; x += 7) {
    const auto match = matcher.Match(left, right, x, 100, 100, kMaxDisparity);
    if (!match) continue;
    EXPECT_EQ(match->position, x * StereoMatcher::kSubpixels);
    ++num;
  }
  EXPECT_GE(num, 20);
}

TEST(StereoMatcherLimits, RowsMayDiffer) {
  const LevelImage left = Whole(WaveImage(kWidth, kHeight)), right = Whole(WaveImage(kWidth, kHeight, 9.4, 3.0));
  StereoMatcher matcher;
  const auto in_its_row = matcher.Match(left, right, 200, 100, 103, kMaxDisparity);
  const auto beside = matcher.Match(left, right, 200, 100, 104, kMaxDisparity);
  ASSERT_TRUE(in_its_row.has_value());
  EXPECT_NEAR(static_cast<double>(in_its_row->position) / StereoMatcher::kSubpixels, 200.0 - 9.4, 0.05);
  if (beside) {
    EXPECT_LT(in_its_row->cost, beside->cost);
  }
}

}  // namespace
}  // namespace tessera
