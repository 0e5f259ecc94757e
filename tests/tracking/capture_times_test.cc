#include "tracking/capture_times.h"

#include <gtest/gtest.h>

#include "support/vga_camera.h"

namespace tessera {
namespace {

const Eigen::Vector3d kFloor(0.05, 0.45, 0.4);  // a . point = 1, in the camera

// A depth camera above a slanted floor, whose depths are measured `delay_us` after the image.
FeatureFrame FloorAt(int64_t delay_us) {
  FeatureFrame features;
  features.calibration = VgaCamera(SensorType::kRgbd);
  features.depth_delay_us = delay_us;
  for (int y = 100; y < 480; y += 20) {
    for (int x = 20; x < 640; x += 20) {
      const Eigen::Vector3d ray = features.calibration.Ray(Eigen::Vector2d(x, y));
      features.keypoints.push_back({.x_px = static_cast<float>(x),
                                    .y_px = static_cast<float>(y),
                                    .depth_m = static_cast<float>(1.0 / kFloor.dot(ray))});
    }
  }
  features.descriptors.resize(features.keypoints.size());
  return features;
}

// Over a thirtieth of a second.
CaptureTimes::Step Turn(double yaw_rad) {
  return {Rigid3{ExpSO3({0.0, yaw_rad, 0.0}), Eigen::Vector3d::Zero()}, 1.0 / 30.0};
}

class CaptureTimesTest : public testing::Test {
 protected:
  double DepthAfter(const std::optional<CaptureTimes::Step>& step) const {
    return times_.AtOneTime(late_, last_, TrackedFrame(late_.view), step)->keypoint(0).depth_m;
  }
  static double DepthBy(const CapturedFrame& captured, double yaw_rad) {
    const CaptureTimes::Step step = Turn(yaw_rad);
    return WithDepthsOfImage(*captured.view, captured.surfaces, captured.depth_delay_s,
                             MotionOver(step.last_from_current, step.interval_s))
        .keypoints[0]
        .depth_m;
  }

  CaptureTimes times_;
  const CapturedFrame late_ = times_.Captured(FloorAt(20'000), {});
  const TrackedFrame last_{late_.view};
};

TEST_F(CaptureTimesTest, ADelayThatIsTooShortToMatterIsNone) {
  EXPECT_EQ(late_.depth_delay_s, 0.02);
  EXPECT_FALSE(late_.surfaces.empty());
  const CapturedFrame on_time = times_.Captured(FloorAt(500), {});
  EXPECT_EQ(on_time.depth_delay_s, 0.0);
  EXPECT_TRUE(on_time.surfaces.empty());
  EXPECT_EQ(times_.AtOneTime(on_time, last_, TrackedFrame(on_time.view), Turn(0.05)), on_time.view);
}

TEST_F(CaptureTimesTest, NothingIsMovedWhileTheMotionIsUnknown) {
  EXPECT_EQ(times_.AtOneTime(late_, last_), late_.view);
  EXPECT_EQ(times_.AtOneTime(late_, last_, TrackedFrame(late_.view), std::nullopt), late_.view);
}

TEST_F(CaptureTimesTest, TheFirstStepIsTakenToBeSteady) {
  EXPECT_NE(DepthAfter(Turn(0.05)), late_.view->keypoint(0).depth_m);
  EXPECT_EQ(DepthAfter(Turn(0.05)), DepthBy(late_, 0.05));
}

// A camera that turns ever faster turns faster at the end of a step than over all of it.
TEST_F(CaptureTimesTest, TheNextStepsGoOnAsTheyChange) {
  times_.Follow(Turn(0.05));
  EXPECT_NEAR(DepthAfter(Turn(0.06)), DepthBy(late_, 0.065), 1e-5);
  EXPECT_EQ(times_.AtOneTime(late_, last_)->keypoint(0).depth_m, static_cast<float>(DepthBy(late_, 0.05)));
}

TEST_F(CaptureTimesTest, AStepOfALongTimeSaysNothing) {
  CaptureTimes::Step step = Turn(0.05);
  step.interval_s = 0.1;
  times_.Follow(step);
  EXPECT_EQ(times_.AtOneTime(late_, last_), late_.view);
}

TEST_F(CaptureTimesTest, ForgetsTheMotion) {
  times_.Follow(Turn(0.05));
  times_.ForgetMotion();
  EXPECT_EQ(times_.AtOneTime(late_, last_), late_.view);
}

}  // namespace
}  // namespace tessera
