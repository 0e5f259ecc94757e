#include "datasets/remap_table.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "core/errors.h"

namespace tessera {
namespace {

constexpr int kWidth = 61, kHeight = 37;  // of the original image
constexpr int kNewWidth = 45, kNewHeight = 40;

// Places all over the original image, in steps of 1/32 px.
struct Places {
  cv::Mat whole = cv::Mat(kNewHeight, kNewWidth, CV_16SC2);
  cv::Mat fraction = cv::Mat(kNewHeight, kNewWidth, CV_16UC1);

  void Put(int row, int column, int x_32nds, int y_32nds) {
    whole.at<cv::Vec2s>(row, column) = {static_cast<int16_t>(x_32nds >> 5), static_cast<int16_t>(y_32nds >> 5)};
    fraction.at<uint16_t>(row, column) = static_cast<uint16_t>((y_32nds & 31) * 32 + (x_32nds & 31));
  }
  Places() {
    for (int row = 0; row < kNewHeight; ++row) {
      for (int column = 0; column < kNewWidth; ++column) {
        const int i = row * kNewWidth + column;
        Put(row, column, i * 977 % (32 * (kWidth - 1) + 1), i * 613 % (32 * (kHeight - 1) + 1));
      }
    }
    Put(0, 0, 0, 0);
    Put(0, 1, 32 * (kWidth - 1), 32 * (kHeight - 1));  // the last pixel, which has no neighbors
  }
  RemapTable Table() const { return {whole, fraction, kWidth, kHeight}; }
};

template <class Pixel>
Image<Pixel> Noise(uint32_t seed) {
  Image<Pixel> image(kWidth, kHeight);
  for (Pixel& pixel : image.pixels) {
    seed = 1664525 * seed + 1013904223;
    pixel = static_cast<Pixel>((seed & 1) != 0 ? seed >> 16 : (seed & 2) != 0 ? 0xFFFF : 0);  // extremes are frequent
  }
  return image;
}

TEST(RemapTable, GraysAreThoseOfOpenCv) {
  const Places places;
  GrayImage image = Noise<uint8_t>(1);
  GrayImage expected(kNewWidth, kNewHeight);
  cv::Mat to(kNewHeight, kNewWidth, CV_8UC1, expected.pixels.data());
  cv::remap(cv::Mat(kHeight, kWidth, CV_8UC1, image.pixels.data()), to, places.whole, places.fraction, cv::INTER_LINEAR,
            cv::BORDER_REPLICATE);
  EXPECT_EQ(places.Table().Interpolate(image), expected);
}

TEST(RemapTable, EachColorIsInterpolatedAsGraysAre) {
  const RemapTable table = Places().Table();
  const GrayImage red = Noise<uint8_t>(1), green = Noise<uint8_t>(2), blue = Noise<uint8_t>(3);
  ColorImage image(kWidth, kHeight);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = {red.pixels[i], green.pixels[i], blue.pixels[i]};
  const ColorImage result = table.Interpolate(image);
  ASSERT_EQ(result.width, kNewWidth);
  const GrayImage new_red = table.Interpolate(red), new_green = table.Interpolate(green),
                  new_blue = table.Interpolate(blue);
  for (size_t i = 0; i < result.pixels.size(); ++i) {
    ASSERT_EQ(result.pixels[i], (Rgb{new_red.pixels[i], new_green.pixels[i], new_blue.pixels[i]})) << i;
  }
}

TEST(RemapTable, DepthIsTheNearestPixels) {
  Places places;
  places.Put(0, 2, 32 * 7 + 15, 32 * 5 + 16);
  const DepthImage image = Noise<uint16_t>(4);
  const DepthImage result = places.Table().Nearest(image);
  EXPECT_EQ(result.row(0)[0], image.row(0)[0]);
  EXPECT_EQ(result.row(0)[1], image.row(kHeight - 1)[kWidth - 1]);
  EXPECT_EQ(result.row(0)[2], image.row(6)[7]);
}

TEST(RemapTable, PlacesOutsideAreMovedToTheBorder) {
  Places places;
  places.Put(0, 0, -3 * 32 + 5, 4 * 32);
  places.Put(0, 1, 6 * 32, -1);
  places.Put(0, 2, 32 * kWidth + 9, 32 * kHeight + 20);
  const GrayImage image = Noise<uint8_t>(5);
  const GrayImage result = places.Table().Interpolate(image);
  EXPECT_EQ(result.row(0)[0], image.row(4)[0]);
  EXPECT_EQ(result.row(0)[1], image.row(0)[6]);
  EXPECT_EQ(result.row(0)[2], image.row(kHeight - 1)[kWidth - 1]);
}

TEST(RemapTable, RefusesImagesWithoutNeighbors) {
  const Places places;
  EXPECT_THROW(RemapTable(places.whole, places.fraction, 1, kHeight), InputError);
  EXPECT_THROW(RemapTable(places.whole, places.fraction, kWidth, 1), InputError);
}

}  // namespace
}  // namespace tessera
