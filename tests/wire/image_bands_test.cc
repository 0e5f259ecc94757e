// Images cut into bands and joined again are the same; bands that lie about their place are refused.
#include "wire/image_bands.h"

#include <gtest/gtest.h>

#include <climits>
#include <numeric>

namespace tessera {
namespace {

template <class Pixel>
Image<Pixel> Ramp(int width, int height) {
  Image<Pixel> image(width, height);
  std::iota(image.pixels.begin(), image.pixels.end(), Pixel{0});
  return image;
}

template <class Pixel>
void ExpectCutAndJoined(size_t max_bytes) {
  const Image<Pixel> image = Ramp<Pixel>(37, 11);
  Image<Pixel> joined;
  for (size_t next = 0; next < image.pixels.size();) {
    image_band_t band;
    next += FillBand(image_band_t::LEFT, image, next, max_bytes, &band);
    EXPECT_LE(band.data.size(), max_bytes);
    ASSERT_TRUE(AppendBand(band, image.width, image.height, &joined));
  }
  EXPECT_EQ(joined, image);
}

TEST(ImageBands, CutAndJoinedAreTheWhole) {
  for (const size_t max_bytes : {2U, 17U, 37U, 74U, 80U, 200U, 100000U}) {
    ExpectCutAndJoined<uint8_t>(max_bytes);
    ExpectCutAndJoined<uint16_t>(max_bytes);
  }
}

TEST(ImageBands, ABandHasWholeRowsWhereARowFits) {
  image_band_t band;
  EXPECT_EQ(FillBand(image_band_t::LEFT, Ramp<uint8_t>(10, 4), 0, 29, &band), 20U);
  EXPECT_EQ(band.pixels.height, 2);
  EXPECT_EQ(FillBand(image_band_t::LEFT, Ramp<uint8_t>(10, 4), 0, 9, &band), 9U);
  EXPECT_EQ(FillBand(image_band_t::LEFT, Ramp<uint8_t>(10, 4), 9, 9, &band), 1U);
}

TEST(ImageBands, RectanglesThatAreNotNextAreRefused) {
  image_band_t band;
  FillBand(image_band_t::LEFT, Ramp<uint8_t>(10, 4), 0, 20, &band);
  for (const int32_t wrong : {INT_MIN, -1, 11, INT_MAX}) {
    for (int32_t rect_t::* const member : {&rect_t::x, &rect_t::y, &rect_t::width, &rect_t::height}) {
      image_band_t spoiled = band;
      spoiled.pixels.*member = wrong;
      GrayImage image;
      EXPECT_FALSE(AppendBand(spoiled, 10, 4, &image)) << wrong;
      EXPECT_TRUE(image.empty());
    }
  }
  GrayImage begun = Ramp<uint8_t>(10, 1);
  EXPECT_FALSE(AppendBand(band, 10, 4, &begun)) << "its first row is there already";
}

TEST(ImageBands, BytesThatDoNotFitTheRectangleAreRefused) {
  image_band_t band;
  FillBand(image_band_t::LEFT, Ramp<uint8_t>(10, 4), 0, 20, &band);
  GrayImage image;
  DepthImage depth;
  EXPECT_FALSE(AppendBand(band, 10, 4, &depth)) << "it is encoded as gray";
  band.data.pop_back();
  --band.num_bytes;
  EXPECT_FALSE(AppendBand(band, 10, 4, &image));
}

}  // namespace
}  // namespace tessera
