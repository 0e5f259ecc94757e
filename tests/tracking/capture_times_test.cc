#include "tracking/capture_times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

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

// Turns by steps of random length, the right image 6 ms later than the left one, at 10 images a second: too few to tell
// a readout, but not this.
TEST(CaptureTimes, RightColumnsAreMovedToTheTimeOfTheLeftImage) {
  constexpr double kDelay_s = 0.006, kInterval_s = 0.1;
  CameraCalibration camera = VgaCamera(SensorType::kStereo);
  camera.baseline_m = 0.1;
  std::mt19937 random(5);
  std::normal_distribution<double> gaussian;
  std::uniform_real_distribution<double> uniform;
  MapReplica replica;
  replica.Send(KeyframeId{0}, {KeyframeId{}, Rigid3::Identity(), {}});
  CaptureTimes times;
  times.BecomeReference(KeyframeId{0});
  double last_turn_rad = 0.0, off_px = 0.0, moved_off_px = 0.0;
  for (int k = 0; k < 60; ++k) {
    const double turn_rad = k == 0 ? 0.0 : 0.1 * gaussian(random);
    const double rate = (turn_rad + 0.5 * (turn_rad - last_turn_rad)) / kInterval_s;  // at the end of the step
    last_turn_rad = turn_rad;
    const Eigen::Quaterniond later_from_now = ExpSO3({0.0, -kDelay_s * rate, 0.0});
    FeatureFrame features;
    features.calibration = camera;
    std::vector<SeenPoint> points;
    std::vector<double> right_columns;
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector2d pixel(150.0 + 490.0 * uniform(random), 480.0 * uniform(random));
      const Eigen::Vector3d point = (1.0 + 2.0 * uniform(random)) * camera.Ray(pixel);
      const Eigen::Vector3d baseline(camera.baseline_m, 0.0, 0.0);
      right_columns.push_back(camera.Project(point - baseline).x());
      const double noise_px = 0.3 * gaussian(random);
      features.keypoints.push_back(
          {.x_px = static_cast<float>(pixel.x()),
           .y_px = static_cast<float>(pixel.y()),
           .right_x_px = static_cast<float>(camera.Project(later_from_now * point - baseline).x() + noise_px)});
      points.push_back({{LandmarkId{}, KeyframeId{0}, i}, {}});
      points.back().landmark.position_in_world = point;
    }
    features.descriptors.resize(features.keypoints.size());
    const CapturedFrame captured = times.Captured(features, {});
    const CaptureTimes::Step step{{ExpSO3({0.0, turn_rad, 0.0}), Eigen::Vector3d::Zero()}, kInterval_s};
    TrackedFrame tracked(times.AtOneTime(captured, TrackedFrame(captured.view), TrackedFrame(captured.view), step));
    tracked.points = points;
    if (k >= 50) {
      for (int i = 0; i < 100; ++i) {
        const double column = right_columns[static_cast<size_t>(i)];
        off_px += std::abs(captured.view->observation(i).right_x_px - column);
        moved_off_px += std::abs(tracked.view->observation(i).right_x_px - column);
      }
    }
    times.Follow(step);
    times.Learn(tracked, Rigid3::Identity(), replica);
  }
  EXPECT_NEAR(times.right_delay_s(), kDelay_s, 0.0005);
  EXPECT_LT(moved_off_px, 0.2 * off_px);
}

}  // namespace
}  // namespace tessera
