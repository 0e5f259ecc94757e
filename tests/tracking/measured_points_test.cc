#include "tracking/measured_points.h"

#include <gtest/gtest.h>

#include <memory>

#include "support/vga_camera.h"

namespace tessera {
namespace {

// Keypoints 0 to 9 see points 2 m before the camera, whose depths were measured.
TrackedFrame FrameOfTen() {
  FeatureFrame features;
  features.calibration = VgaCamera(SensorType::kRgbd);
  for (int i = 0; i < 10; ++i) {
    features.keypoints.push_back({.x_px = 50.0F + 50.0F * static_cast<float>(i), .y_px = 200.0F, .depth_m = 2.0F});
  }
  features.descriptors.resize(features.keypoints.size());
  TrackedFrame frame(std::make_shared<const FrameView>(features));
  for (int i = 0; i < 10; ++i) {
    SeenPoint& seen = frame.points[Index(i)];
    seen.id = {LandmarkId{i}, {}, -1};
    seen.landmark.position_in_world = 2.0 * features.calibration.Ray(frame.view->pixel(i));
  }
  return frame;
}

TEST(MeasuredPoints, AreAllIfTheyAreNotTooMany) {
  EXPECT_EQ(MeasuredPoints(FrameOfTen(), 11).size(), 10U);
  EXPECT_EQ(MeasuredPoints(FrameOfTen(), 5), (std::vector<int>{0, 3, 6, 9}));
}

TEST(MeasuredPoints, SeeAPointBeforeTheCamera) {
  TrackedFrame frame = FrameOfTen();
  frame.points[1] = {};
  frame.points[2].landmark.position_in_world.z() = -2.0;
  EXPECT_EQ(MeasuredPoints(frame, 100), (std::vector<int>{0, 3, 4, 5, 6, 7, 8, 9}));
}

TEST(MeasuredPoints, HaveADepthOfTheirOwn) {
  TrackedFrame frame = FrameOfTen();
  FeatureFrame features = frame.view->features();
  features.keypoints[4].depth_m = 0.0F;
  frame.view = std::make_shared<const FrameView>(features);
  EXPECT_EQ(MeasuredPoints(frame, 100), (std::vector<int>{0, 1, 2, 3, 5, 6, 7, 8, 9}));
}

}  // namespace
}  // namespace tessera
