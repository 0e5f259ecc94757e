#include "tracking/repeated_images.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

FeatureFrame FrameOf(int64_t number, float x_px, float depth_m = 1.0F) {
  FeatureFrame frame;
  frame.frame = {number};
  frame.keypoints = {{.x_px = x_px, .y_px = 7.0F, .depth_m = depth_m}, {.x_px = 50.0F, .y_px = 60.0F}};
  return frame;
}

TEST(RepeatedImages, AreThoseWhoseKeypointsAllStandWhereTheyStood) {
  RepeatedImages images;
  EXPECT_FALSE(images.Contains(FrameOf(0, 10.0F)));
  EXPECT_TRUE(images.Contains(FrameOf(1, 10.0F)));
  EXPECT_TRUE(images.Contains(FrameOf(2, 10.0F)));
  EXPECT_FALSE(images.Contains(FrameOf(3, 10.5F)));
  EXPECT_FALSE(images.Contains(FrameOf(4, 10.0F)));
  EXPECT_EQ(images.num(), 2);
}

TEST(RepeatedImages, MayComeWithNewDepths) {
  RepeatedImages images;
  images.Contains(FrameOf(0, 10.0F, 1.0F));
  EXPECT_TRUE(images.Contains(FrameOf(1, 10.0F, 1.1F)));
}

TEST(RepeatedImages, AFrameThatIsShownTwiceCountsOnce) {
  RepeatedImages images;
  EXPECT_FALSE(images.Contains(FrameOf(0, 10.0F)));
  EXPECT_FALSE(images.Contains(FrameOf(0, 10.0F)));
  EXPECT_TRUE(images.Contains(FrameOf(1, 10.0F)));
  EXPECT_TRUE(images.Contains(FrameOf(1, 10.0F)));
  EXPECT_EQ(images.num(), 1);
}

TEST(RepeatedImages, ImagesWithoutKeypointsAreNone) {
  RepeatedImages images;
  EXPECT_FALSE(images.Contains({.frame = {0}}));
  EXPECT_FALSE(images.Contains({.frame = {1}}));
}

}  // namespace
}  // namespace tessera
