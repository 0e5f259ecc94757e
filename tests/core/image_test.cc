#include "core/image.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(Image, CropTakesThePixelsOfTheRectangle) {
  GrayImage image(5, 4);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 5; ++x) image.row(y)[x] = static_cast<uint8_t>(10 * y + x);
  }
  const GrayImage crop = Crop(image, {.x = 1, .y = 2, .width = 3, .height = 2});
  EXPECT_EQ(crop.width, 3);
  EXPECT_EQ(crop.height, 2);
  EXPECT_EQ(crop.pixels, (std::vector<uint8_t>{21, 22, 23, 31, 32, 33}));
  EXPECT_EQ(Crop(image, {.x = 0, .y = 0, .width = 5, .height = 4}), image);
}

}  // namespace
}  // namespace tessera
