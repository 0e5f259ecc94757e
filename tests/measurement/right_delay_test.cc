#include "measurement/right_delay.h"

#include <gtest/gtest.h>

#include <random>

#include "support/vga_camera.h"

namespace tessera {
namespace {

constexpr double kDelay_s = 0.012;
const CameraMotion kMotion{{0.8, -0.2, 0.5}, {0.3, 1.5, -0.4}};

CameraCalibration Camera() {
  CameraCalibration camera = VgaCamera(SensorType::kStereo);
  camera.baseline_m = 0.1;
  return camera;
}

// The column at which the right camera sees a point of the left camera's frame, `time_s` later.
double ColumnLater(const Eigen::Vector3d& point, double time_s) {
  const Rigid3 now_from_later{ExpSO3(time_s * kMotion.turn_rate), time_s * kMotion.velocity};
  const Eigen::Vector3d in_right = now_from_later.Inverse() * point - Eigen::Vector3d(Camera().baseline_m, 0.0, 0.0);
  return Camera().Project(in_right).x();
}

FeatureFrame SeenTogether(const Eigen::Vector3d& point, double right_x_px) {
  const Eigen::Vector2d pixel = Camera().Project(point);
  FeatureFrame features;
  features.calibration = Camera();
  features.keypoints = {{.x_px = static_cast<float>(pixel.x()),
                         .y_px = static_cast<float>(pixel.y()),
                         .right_x_px = static_cast<float>(right_x_px)}};
  features.descriptors.resize(1);
  return features;
}

TEST(RightDelay, ColumnsChangeAsFastAsThePointGoesBy) {
  const Eigen::Vector3d point(0.4, -0.3, 3.0);
  const double difference = (ColumnLater(point, 1e-5) - ColumnLater(point, -1e-5)) / 2e-5;
  EXPECT_NEAR(RightColumnRate(Camera(), point, kMotion), difference, 1e-3);
}

TEST(RightDelay, ColumnsAreThoseOfTheImagesTime) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.4, 0.4);
  for (const double delay_s : {kDelay_s, -kDelay_s}) {
    for (int i = 0; i < 50; ++i) {
      const double depth = 1.0 + 3.0 * (0.5 + uniform(random));
      const Eigen::Vector3d point(depth * uniform(random), depth * uniform(random), depth);
      const FeatureFrame features = SeenTogether(point, ColumnLater(point, delay_s));
      const Keypoint moved = WithRightColumnsOfImage(features, delay_s, kMotion).keypoints[0];
      EXPECT_NEAR(static_cast<double>(moved.right_x_px), ColumnLater(point, 0.0), 0.01);
      EXPECT_EQ(moved.x_px, features.keypoints[0].x_px);
    }
  }
}

TEST(RightDelay, KeypointsThatOnlyOneEyeSawStaySo) {
  const FeatureFrame features = SeenTogether({0.1, 0.2, 2.0}, -1.0);
  EXPECT_LT(WithRightColumnsOfImage(features, kDelay_s, kMotion).keypoints[0].right_x_px, 0.0F);
}

// Nothing is farther than infinitely far: by a little, that is noise.
TEST(RightDelay, RaysThatPartHaveNoDepth) {
  const Eigen::Vector3d far(2e4, 1e4, 1e5);
  const double column_px = ColumnLater(far, kDelay_s);
  const Keypoint by_noise = WithRightColumnsOfImage(SeenTogether(far, column_px + 0.5), kDelay_s, kMotion).keypoints[0];
  EXPECT_EQ(by_noise.right_x_px, by_noise.x_px);
  const Keypoint parted = WithRightColumnsOfImage(SeenTogether(far, column_px + 3.0), kDelay_s, kMotion).keypoints[0];
  EXPECT_LT(parted.right_x_px, 0.0F);
}

}  // namespace
}  // namespace tessera
