#include "occupancy/waiting_image.h"

#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace tessera {
namespace {

CameraFrame Stereo() {
  CameraFrame frame{.id = {7}, .utime_us = 12, .sensor = SensorType::kStereo};
  frame.left = GrayImage(5, 3, 10);
  frame.right = GrayImage(5, 3, 20);
  return frame;
}

CameraFrame Rgbd() {
  CameraFrame frame{.id = {8}, .sensor = SensorType::kRgbd};
  frame.left = GrayImage(4, 2, 30);
  frame.depth = DepthImage(4, 2, 40000);
  return frame;
}

TEST(WaitingImage, ComesBackFromTheDiskAsItWas) {
  const TemporaryFolder folder;
  ScratchFile file(folder.path());
  for (const CameraFrame& frame : {Stereo(), Rgbd()}) {
    WaitingImage<CameraFrame> waiting{frame, std::nullopt};
    EXPECT_EQ(waiting.bytes_in_memory(), BytesOf(frame));
    ASSERT_TRUE(MoveToDisk(waiting, file));
    EXPECT_EQ(waiting.bytes_in_memory(), 0);
    EXPECT_EQ(MoveBack(waiting, &file), frame);
  }
  const ColorImage color(3, 2, Rgb{1, 2, 3});
  WaitingImage<ColorImage> waiting{color, std::nullopt};
  ASSERT_TRUE(MoveToDisk(waiting, file));
  EXPECT_EQ(MoveBack(waiting, &file), color);
}

TEST(WaitingImage, StaysInMemoryWhereTheDiskDoesNotTakeIt) {
  ScratchFile nowhere("/dev/null/folder");
  WaitingImage<CameraFrame> waiting{Stereo(), std::nullopt};
  EXPECT_FALSE(MoveToDisk(waiting, nowhere));
  EXPECT_EQ(MoveBack(waiting, nullptr), Stereo());
}

}  // namespace
}  // namespace tessera
