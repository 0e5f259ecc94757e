#include "loop_closing/gap_motion.h"

#include <gtest/gtest.h>

#include <memory>

namespace tessera {
namespace {

// A mono keyframe on the z axis, `z` units of its part of the map ahead.
Keyframe At(double seconds, double z) {
  auto features = std::make_shared<FeatureFrame>();
  features->utime_us = static_cast<int64_t>(1e6 * seconds);
  features->calibration.sensor = SensorType::kMono;
  Keyframe keyframe;
  keyframe.features = std::move(features);
  keyframe.world_from_camera.translation = {0.0, 0.0, z};
  return keyframe;
}

TEST(GapMotion, KeepsTheSpeedWhichGivesTheRatioOfTheUnits) {
  // 2 units/s before, 1 unit/s of the other part after: its units are twice as long.
  const auto gap = MotionAcrossGap(At(0.0, 0.0), At(1.0, 2.0), At(4.0, 7.0), At(5.0, 8.0));
  ASSERT_TRUE(gap);
  EXPECT_NEAR(gap->before_from_after.scale, 2.0, 1e-12);
  EXPECT_NEAR((gap->before_from_after.translation - Eigen::Vector3d(0.0, 0.0, 6.0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(gap->before_from_after.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.0, 1e-12);
}

TEST(GapMotion, IsLessCertainTheLongerTheGap) {
  const auto brief = MotionAcrossGap(At(0.0, 0.0), At(1.0, 2.0), At(2.0, 7.0), At(3.0, 8.0));
  const auto extended = MotionAcrossGap(At(0.0, 0.0), At(1.0, 2.0), At(5.0, 7.0), At(6.0, 8.0));
  ASSERT_TRUE(brief && extended);
  EXPECT_LT(brief->covariance(2, 2), extended->covariance(2, 2));
  EXPECT_LT(brief->covariance(4, 4), extended->covariance(4, 4));
}

TEST(GapMotion, IsUnknownAfterALongGapOrWhereTheCameraStood) {
  EXPECT_FALSE(MotionAcrossGap(At(0.0, 0.0), At(1.0, 2.0), At(1.1 + kMaxGap_s, 7.0), At(12.5, 8.0)));
  EXPECT_FALSE(MotionAcrossGap(At(0.0, 2.0), At(1.0, 2.0), At(2.0, 7.0), At(3.0, 8.0)));
}

}  // namespace
}  // namespace tessera
