#include "measurement/rolling_shutter.h"

#include <gmock/gmock.h>

#include "support/matchers.h"
#include "support/vga_camera.h"

namespace tessera {
namespace {

constexpr Readout kReadout{.down_s = 0.025};
const CameraMotion kMotion{{0.3, -0.1, 0.2}, {0.4, 2.5, -0.3}};

FeatureFrame FrameOf(const std::vector<Eigen::Vector2d>& pixels, double depth) {
  FeatureFrame frame;
  frame.calibration = VgaCamera(SensorType::kRgbd);
  for (const Eigen::Vector2d& pixel : pixels) {
    frame.keypoints.push_back({.x_px = static_cast<float>(pixel.x()),
                               .y_px = static_cast<float>(pixel.y()),
                               .depth_m = static_cast<float>(depth)});
  }
  frame.descriptors.resize(pixels.size());
  return frame;
}

// Where a camera that moves so sees the point: at the pixel that is read just when the point is there.
Eigen::Vector3d AsRead(const CameraCalibration& camera, const Readout& readout,
                       const Eigen::Vector3d& point_in_middle) {
  Eigen::Vector3d point = point_in_middle;
  for (int i = 0; i < 20; ++i) {
    const double time_s = ReadTime(readout, camera, camera.Project(point));
    const Rigid3 middle_from_read{ExpSO3(time_s * kMotion.turn_rate), time_s * kMotion.velocity};
    point = middle_from_read.Inverse() * point_in_middle;
  }
  return point;
}

class Unrolled : public ::testing::TestWithParam<Readout> {};

TEST_P(Unrolled, KeypointsMoveToWhereThePoseOfTheMiddleSeesThem) {
  const CameraCalibration camera = FrameOf({}, 0.0).calibration;
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(-0.4, -0.6, 1.5), Eigen::Vector3d(0.8, 0.9, 2.5)}) {
    const Eigen::Vector3d seen = AsRead(camera, GetParam(), point);
    const FeatureFrame unrolled = Unroll(FrameOf({camera.Project(seen)}, seen.z()), {seen.z()}, GetParam(), kMotion);
    const Keypoint& keypoint = unrolled.keypoints[0];
    EXPECT_GT((camera.Project(seen) - camera.Project(point)).norm(), 5.0);
    EXPECT_NEAR(keypoint.x_px, camera.Project(point).x(), 1e-2);
    EXPECT_NEAR(keypoint.y_px, camera.Project(point).y(), 1e-2);
    EXPECT_NEAR(keypoint.depth_m, point.z(), 1e-4);
  }
}

INSTANTIATE_TEST_SUITE_P(HoweverTheCameraStands, Unrolled,
                         ::testing::Values(Readout{.down_s = 0.025}, Readout{.down_s = -0.025},
                                           Readout{.across_s = 0.025}, Readout{.across_s = -0.025}));

TEST(RollingShutter, FarPointsMoveWithTheRotationAlone) {
  const FeatureFrame frame = FrameOf({{100.0, 50.0}}, 0.0);
  const Keypoint far = Unroll(frame, {0.0}, kReadout, kMotion).keypoints[0];
  const Keypoint turned = Unroll(frame, {1.0}, kReadout, {Eigen::Vector3d::Zero(), kMotion.turn_rate}).keypoints[0];
  EXPECT_EQ(far, turned);
  EXPECT_EQ(far.depth_m, 0.0F);
}

TEST(RollingShutter, TheMiddleRowStaysWhereItIs) {
  const FeatureFrame frame = FrameOf({{100.0, 239.5}}, 2.0);
  EXPECT_EQ(Unroll(frame, {2.0}, kReadout, kMotion).keypoints, frame.keypoints);
}

TEST(RollingShutter, KeypointsThatWouldLeaveTheSurroundingsOfTheImageStay) {
  const FeatureFrame frame = FrameOf({{600.0, 470.0}}, 2.0);
  EXPECT_EQ(Unroll(frame, {2.0}, {.down_s = 1.0}, {Eigen::Vector3d::Zero(), {0.0, 2.5, 0.0}}).keypoints,
            frame.keypoints);
}

TEST(RollingShutter, MotionOverAnIntervalIsThatOfItsStep) {
  const CameraMotion motion = MotionOver({ExpSO3({0.0, 0.1, 0.0}), {0.02, 0.0, 0.04}}, 0.05);
  EXPECT_TRUE(motion.turn_rate.isApprox(Eigen::Vector3d(0.0, 2.0, 0.0), 1e-9));
  EXPECT_TRUE(motion.velocity.isApprox(Eigen::Vector3d(0.4, 0.0, 0.8), 1e-9));
}

}  // namespace
}  // namespace tessera
