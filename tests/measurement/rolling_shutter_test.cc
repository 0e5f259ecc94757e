#include "measurement/rolling_shutter.h"

#include <gmock/gmock.h>

#include "support/matchers.h"
#include "support/vga_camera.h"

namespace tessera {
namespace {

constexpr double kReadout_s = 0.025;
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

// Where a camera that moves so sees the point: in the row that is read just when the point is there.
Eigen::Vector3d InItsRow(const CameraCalibration& camera, const Eigen::Vector3d& point_in_middle) {
  Eigen::Vector3d point = point_in_middle;
  for (int i = 0; i < 20; ++i) {
    const double time_s = kReadout_s * RowTime(camera, camera.Project(point).y());
    const Rigid3 middle_from_row{ExpSO3(time_s * kMotion.turn_rate), time_s * kMotion.velocity};
    point = middle_from_row.Inverse() * point_in_middle;
  }
  return point;
}

TEST(RollingShutter, KeypointsMoveToWhereTheMiddleRowsPoseSeesThem) {
  const CameraCalibration camera = FrameOf({}, 0.0).calibration;
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(-0.4, -0.6, 1.5), Eigen::Vector3d(0.8, 0.9, 2.5)}) {
    const Eigen::Vector3d seen = InItsRow(camera, point);
    const FeatureFrame unrolled = Unroll(FrameOf({camera.Project(seen)}, seen.z()), {seen.z()}, kReadout_s, kMotion);
    const Keypoint& keypoint = unrolled.keypoints[0];
    EXPECT_GT((camera.Project(seen) - camera.Project(point)).norm(), 5.0);
    EXPECT_NEAR(keypoint.x_px, camera.Project(point).x(), 1e-2);
    EXPECT_NEAR(keypoint.y_px, camera.Project(point).y(), 1e-2);
    EXPECT_NEAR(keypoint.depth_m, point.z(), 1e-4);
  }
}

TEST(RollingShutter, FarPointsMoveWithTheRotationAlone) {
  const FeatureFrame frame = FrameOf({{100.0, 50.0}}, 0.0);
  const Keypoint far = Unroll(frame, {0.0}, kReadout_s, kMotion).keypoints[0];
  const Keypoint turned = Unroll(frame, {1.0}, kReadout_s, {Eigen::Vector3d::Zero(), kMotion.turn_rate}).keypoints[0];
  EXPECT_EQ(far, turned);
  EXPECT_EQ(far.depth_m, 0.0F);
}

TEST(RollingShutter, TheMiddleRowStaysWhereItIs) {
  const FeatureFrame frame = FrameOf({{100.0, 239.5}}, 2.0);
  EXPECT_EQ(Unroll(frame, {2.0}, kReadout_s, kMotion).keypoints, frame.keypoints);
}

TEST(RollingShutter, KeypointsThatWouldLeaveTheSurroundingsOfTheImageStay) {
  const FeatureFrame frame = FrameOf({{600.0, 470.0}}, 2.0);
  EXPECT_EQ(Unroll(frame, {2.0}, 1.0, {Eigen::Vector3d::Zero(), {0.0, 2.5, 0.0}}).keypoints, frame.keypoints);
}

TEST(RollingShutter, MotionOverAnIntervalIsThatOfItsStep) {
  const CameraMotion motion = MotionOver({ExpSO3({0.0, 0.1, 0.0}), {0.02, 0.0, 0.04}}, 0.05);
  EXPECT_TRUE(motion.turn_rate.isApprox(Eigen::Vector3d(0.0, 2.0, 0.0), 1e-9));
  EXPECT_TRUE(motion.velocity.isApprox(Eigen::Vector3d(0.4, 0.0, 0.8), 1e-9));
}

}  // namespace
}  // namespace tessera
