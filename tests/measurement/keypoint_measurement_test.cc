#include "measurement/keypoint_measurement.h"

#include <gmock/gmock.h>

#include "measurement/frame_view.h"
#include "support/matchers.h"

namespace tessera {
namespace {

const Eigen::Vector3d kPoint(1.0, -0.5, 8.0);

// One keypoint of the given level that shows kPoint.
FeatureFrame FrameOf(SensorType sensor, uint8_t level = 0) {
  FeatureFrame frame;
  frame.calibration = {
      .sensor = sensor, .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240};
  frame.calibration.baseline_m = sensor == SensorType::kStereo ? 0.5 : 0.0;
  const Eigen::Vector2d pixel = frame.calibration.Project(kPoint);
  Keypoint keypoint{.x_px = static_cast<float>(pixel.x()), .y_px = static_cast<float>(pixel.y()), .level = level};
  if (sensor == SensorType::kStereo) keypoint.right_x_px = keypoint.x_px - static_cast<float>(500 * 0.5 / kPoint.z());
  if (sensor == SensorType::kRgbd) keypoint.depth_m = static_cast<float>(kPoint.z());
  frame.keypoints = {keypoint};
  frame.descriptors.resize(1);
  return frame;
}

TEST(KeypointMeasurement, TheNoiseGrowsWithThePyramidLevel) {
  EXPECT_DOUBLE_EQ(SeenAt(FrameOf(SensorType::kMono, 0), 0).sigma_px, KeypointSigmaPx(SensorType::kMono));
  EXPECT_NEAR(SeenAt(FrameOf(SensorType::kMono, 3), 0).sigma_px, KeypointSigmaPx(SensorType::kMono) * 1.2 * 1.2 * 1.2,
              1e-12);
}

TEST(KeypointMeasurement, DepthIsCarriedAsARightColumn) {
  EXPECT_FALSE(SeenAt(FrameOf(SensorType::kMono), 0).has_right());
  const PixelObservation stereo = SeenAt(FrameOf(SensorType::kStereo), 0);
  EXPECT_NEAR(stereo.pixel_px.x() - stereo.right_x_px, 500 * 0.5 / kPoint.z(), 1e-4);
  const PixelObservation rgbd = SeenAt(FrameOf(SensorType::kRgbd), 0);
  EXPECT_NEAR(rgbd.pixel_px.x() - rgbd.right_x_px, 500 * kRgbdBaseline / kPoint.z(), 1e-4);
}

// The depth sensor measures as exactly on every level; a stereo pair's right column is found like the left one.
TEST(KeypointMeasurement, ADepthSensorsDisparityHasASigmaOfItsOwn) {
  for (const uint8_t level : {uint8_t{0}, uint8_t{5}}) {
    EXPECT_EQ(SeenAt(FrameOf(SensorType::kRgbd, level), 0).disparity_sigma_px, kRgbdDisparitySigmaPx);
    EXPECT_EQ(SeenAt(FrameOf(SensorType::kStereo, level), 0).disparity_sigma_px, 0.0);
    EXPECT_EQ(SeenAt(FrameOf(SensorType::kMono, level), 0).disparity_sigma_px, 0.0);
  }
  FeatureFrame without_depth = FrameOf(SensorType::kRgbd);
  without_depth.keypoints[0].depth_m = 0.0F;
  EXPECT_EQ(SeenAt(without_depth, 0).disparity_sigma_px, 0.0);
}

TEST(KeypointMeasurement, ARightColumnThatMakesNoSenseCountsAsNone) {
  FeatureFrame frame = FrameOf(SensorType::kStereo);
  for (const float right_x_px : {-1.0F, frame.keypoints[0].x_px, frame.keypoints[0].x_px + 1.0F}) {
    frame.keypoints[0].right_x_px = right_x_px;
    EXPECT_FALSE(SeenAt(frame, 0).has_right()) << right_x_px;
    EXPECT_FALSE(PointFromDepth(frame, 0).has_value()) << right_x_px;
  }
  FeatureFrame without_depth = FrameOf(SensorType::kRgbd);
  without_depth.keypoints[0].depth_m = 0.0F;
  EXPECT_FALSE(PointFromDepth(without_depth, 0).has_value());
}

TEST(KeypointMeasurement, StereoAndRgbdGiveThePointInTheCameraFrame) {
  for (const SensorType sensor : {SensorType::kStereo, SensorType::kRgbd}) {
    const auto point = PointFromDepth(FrameOf(sensor), 0);
    ASSERT_TRUE(point.has_value());
    EXPECT_THAT(*point, IsNear(kPoint, 1e-4));
  }
  EXPECT_FALSE(PointFromDepth(FrameOf(SensorType::kMono), 0).has_value());
}

TEST(FrameView, MeasuresAsItsFeaturesDo) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo, SensorType::kRgbd}) {
    const FeatureFrame features = FrameOf(sensor, 2);
    const FrameView view(features);
    EXPECT_EQ(view.observation(0).pixel_px, SeenAt(features, 0).pixel_px);
    EXPECT_EQ(view.observation(0).sigma_px, SeenAt(features, 0).sigma_px);
    EXPECT_EQ(view.baseline_m(), Baseline(features.calibration));
  }
}

TEST(FrameView, LeavesOutKeypointsWithoutADescriptor) {
  FeatureFrame features = FrameOf(SensorType::kMono);
  features.keypoints.resize(3);
  features.descriptors.resize(2);
  EXPECT_EQ(FrameView(features).size(), 2);
  features.descriptors.resize(5);
  EXPECT_EQ(FrameView(features).size(), 3);
}

}  // namespace
}  // namespace tessera
