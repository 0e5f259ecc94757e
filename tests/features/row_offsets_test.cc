#include "features/row_offsets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/wave_image.h"

namespace tessera {
namespace {

constexpr int kWidth = 400, kHeight = 200;

GrayImage ImageMoved(double left_px, double down_px, double brightness = 1.0) {
  return WaveImage(kWidth, kHeight, left_px, down_px, brightness);
}

double MedianOf(std::vector<RowOffset> offsets) {
  std::sort(offsets.begin(), offsets.end(), [](auto& a, auto& b) { return a.offset_px < b.offset_px; });
  return offsets[offsets.size() / 2].offset_px;
}

class RowOffsets : public testing::TestWithParam<double> {};

TEST_P(RowOffsets, AreMeasuredBetweenPixels) {
  const double down_px = GetParam();
  const auto offsets = MeasureRowOffsets(ImageMoved(0.0, 0.0), ImageMoved(20.0, down_px), -6, 6);
  ASSERT_GE(offsets.size(), 20U);
  EXPECT_NEAR(MedianOf(offsets), down_px, 0.03);
  const auto is_right = [&](const RowOffset& offset) { return std::abs(offset.offset_px - down_px) < 0.1; };
  EXPECT_GE(std::count_if(offsets.begin(), offsets.end(), is_right), static_cast<ptrdiff_t>(offsets.size() * 9 / 10));
}

INSTANTIATE_TEST_SUITE_P(Px, RowOffsets, testing::Values(0.0, 0.25, -0.4, 1.5, -3.7, 5.1));

TEST(RowOffsetsOfPairs, DoNotDependOnTheirBrightness) {
  const auto offsets = MeasureRowOffsets(ImageMoved(0.0, 0.0), ImageMoved(20.0, 1.3, 0.9), -6, 6);
  ASSERT_GE(offsets.size(), 20U);
  EXPECT_NEAR(MedianOf(offsets), 1.3, 0.05);
}

TEST(RowOffsetsOfPairs, StandWhereTheRightImageShowsThem) {
  for (const RowOffset& offset : MeasureRowOffsets(ImageMoved(0.0, 0.0), ImageMoved(20.0, 2.0), -6, 6)) {
    EXPECT_GE(offset.x_px, 0.0);
    EXPECT_LE(offset.x_px, kWidth - 20.0);
    EXPECT_EQ(offset.y_px, std::round(offset.y_px));
  }
}

TEST(RowOffsetsOfPairs, FlatAndSmallImagesHaveNone) {
  const GrayImage flat(kWidth, kHeight, 90), small(12, 12, 90);
  EXPECT_TRUE(MeasureRowOffsets(flat, flat, -6, 6).empty());
  EXPECT_TRUE(MeasureRowOffsets(small, small, -6, 6).empty());
  EXPECT_TRUE(MeasureRowOffsets(ImageMoved(0.0, 0.0), flat, -6, 6).empty());
}

}  // namespace
}  // namespace tessera
