// Tiles on their way to another machine: packed and unpacked they are the same, bit for bit.
#include "features/tile_packing.h"

#include <gtest/gtest.h>

#include <random>

#include "features/tiling.h"
#include "support/feature_images.h"
#include "support/matchers.h"

namespace tessera {
namespace {

template <class Pixel>
Image<Pixel> Noise(int width, int height, unsigned seed) {
  std::mt19937 generator(seed);
  Image<Pixel> image;
  image.width = width;
  image.height = height;
  image.pixels.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  for (Pixel& pixel : image.pixels) pixel = static_cast<Pixel>(generator());
  return image;
}

TileJob NoiseJob(int width, int height) {
  TileJob job;
  job.left_rect = {0, 0, width, height};
  job.left = Noise<uint8_t>(width, height, 1);
  job.right_rect = {3, 4, width + 5, height};
  job.right = Noise<uint8_t>(width + 5, height, 2);
  job.depth_rect = job.left_rect;
  job.depth = Noise<uint16_t>(width, height, 3);
  return job;
}

size_t NumBytes(const TileJob& job) {
  return job.left.pixels.size() + job.right.pixels.size() + 2 * job.depth.pixels.size();
}

TEST(TilePacking, LosesNothingWhateverThePixels) {
  for (const auto& [width, height] : {std::pair(1, 1), {1, 7}, {9, 1}, {64, 48}, {301, 17}}) {
    const TileJob job = NoiseJob(width, height);
    TileJob packed = PackTile(job);
    EXPECT_TRUE(packed.left.pixels.empty() && packed.right.pixels.empty() && packed.depth.pixels.empty());
    ASSERT_THAT(UnpackTile(packed), IsSuccess());
    EXPECT_TRUE(packed == job) << width << " x " << height;
  }
}

TEST(TilePacking, SmoothImagesBecomeSmall) {
  TileJob job;
  job.left_rect = {0, 0, 640, 480};
  job.left = MakeFlat(640, 480, 0);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) job.left.pixels[static_cast<size_t>(640 * y + x)] = static_cast<uint8_t>((x + y) / 5);
  }
  EXPECT_LT(PackTile(job).packed.pixels.size(), NumBytes(job) / 20);
}

TEST(TilePacking, NoiseGrowsByLittle) {
  const TileJob job = NoiseJob(640, 480);
  EXPECT_LT(PackTile(job).packed.pixels.size(), NumBytes(job) + NumBytes(job) / 100);
}

TEST(TilePacking, WhatIsNotPackedStaysAsItIs) {
  const TileJob job = NoiseJob(20, 10);
  TileJob same = job;
  EXPECT_THAT(UnpackTile(same), IsSuccess());
  EXPECT_TRUE(same == job);
}

TEST(TilePacking, RefusesDamagedBytesAndOtherSizes) {
  const TileJob packed = PackTile(NoiseJob(64, 48));
  TileJob cut = packed;
  cut.packed.pixels.resize(cut.packed.pixels.size() / 2);
  EXPECT_THAT(UnpackTile(cut), IsFailure(HasSubstr("damaged")));
  TileJob flipped = packed;
  flipped.packed.pixels[0] ^= 0xFFU;
  EXPECT_THAT(UnpackTile(flipped), IsFailure(HasSubstr("damaged")));
  for (const int change : {-1, 1}) {
    TileJob other = packed;
    other.left_rect.height += change;
    EXPECT_THAT(UnpackTile(other), IsFailure(HasSubstr("another size")));
  }
  TileJob huge = packed;
  huge.left_rect = {0, 0, 1 << 30, 1 << 30};
  EXPECT_THAT(UnpackTile(huge), IsFailure(HasSubstr("larger")));
}

}  // namespace
}  // namespace tessera
