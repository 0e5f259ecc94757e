#include "datasets/color_pixels.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(ColorPixels, ColorsKeepTheirPlaces) {
  cv::Mat image(2, 3, CV_8UC3, cv::Scalar(30, 20, 10));  // blue first
  image.at<cv::Vec3b>(1, 2) = {3, 2, 1};
  ColorImage expected(3, 2, {.red = 10, .green = 20, .blue = 30});
  expected.row(1)[2] = {.red = 1, .green = 2, .blue = 3};
  EXPECT_EQ(ColorsOf(image), expected);
}

TEST(ColorPixels, AnImageOfGrayPixelsHasNoColors) {
  cv::Mat image(2, 3, CV_8UC3, cv::Scalar(9, 9, 9));
  EXPECT_TRUE(ColorsOf(image).empty());
  image.at<cv::Vec3b>(1, 2) = {9, 9, 10};
  EXPECT_FALSE(ColorsOf(image).empty());
}

}  // namespace
}  // namespace tessera
