#include "measurement/landmark_view.h"

#include <gmock/gmock.h>

#include <cmath>

#include "support/matchers.h"

namespace tessera {
namespace {

constexpr CameraCalibration kCamera{
    .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240};

// A landmark at a position, seen from the origin before, where its patch had the size of level `level`.
Landmark SeenFromOrigin(const Eigen::Vector3d& position, int level = 0) {
  Landmark landmark;
  landmark.position_in_world = position;
  landmark.normal = -position.normalized();
  landmark.max_distance = position.norm() * LevelScale(level);
  landmark.min_distance = landmark.max_distance / LevelScale(kTopLevel);
  return landmark;
}

std::optional<ExpectedView> ExpectFrom(const Rigid3& world_from_camera, const Landmark& landmark) {
  return Expect(View(kCamera, world_from_camera), landmark);
}

TEST(Expect, SeesALandmarkWhereItProjects) {
  const Eigen::Vector3d position(0.4, -0.2, 5.0);
  const auto expected = ExpectFrom({}, SeenFromOrigin(position));
  ASSERT_TRUE(expected.has_value());
  EXPECT_THAT(expected->pixel_px, IsNear(kCamera.Project(position), 1e-9));
  EXPECT_DOUBLE_EQ(expected->depth, 5.0);
  EXPECT_DOUBLE_EQ(expected->distance, position.norm());
  EXPECT_NEAR(expected->cos_angle, 1.0, 1e-12);
}

TEST(Expect, NothingBehindTheCameraOrOffTheImage) {
  EXPECT_FALSE(ExpectFrom({}, SeenFromOrigin({0.0, 0.0, -5.0})).has_value());
  EXPECT_FALSE(ExpectFrom({}, SeenFromOrigin({4.0, 0.0, 5.0})).has_value());
}

TEST(Expect, TheLevelFallsAsTheCameraGoesAway) {
  const Landmark landmark = SeenFromOrigin({0.0, 0.0, 8.0}, 3);
  int last = kTopLevel;
  for (const double z : {3.5, 2.0, 0.0, -2.0, -5.0}) {
    const auto expected = ExpectFrom({Eigen::Quaterniond::Identity(), {0.0, 0.0, z}}, landmark);
    ASSERT_TRUE(expected.has_value()) << z;
    EXPECT_LE(expected->level, last) << z;
    last = expected->level;
  }
  EXPECT_LT(last, 3);
}

TEST(Expect, NothingTooNearOrTooFarForItsPatch) {
  const Landmark landmark = SeenFromOrigin({0.0, 0.0, 8.0}, 3);
  const auto from = [&](double distance) {
    return ExpectFrom({Eigen::Quaterniond::Identity(), {0.0, 0.0, 8.0 - distance}}, landmark);
  };
  EXPECT_FALSE(from(0.79 * landmark.min_distance).has_value());
  EXPECT_TRUE(from(0.81 * landmark.min_distance).has_value());
  EXPECT_TRUE(from(1.19 * landmark.max_distance).has_value());
  EXPECT_FALSE(from(1.21 * landmark.max_distance).has_value());
}

TEST(Expect, NothingFromMoreThan60DegreesAside) {
  const Landmark landmark = SeenFromOrigin({0.0, 0.0, 8.0});
  const auto from = [&](double degrees) {
    const Eigen::Quaterniond turn = ExpSO3({0.0, degrees * M_PI / 180.0, 0.0});
    return ExpectFrom({turn, landmark.position_in_world - turn * Eigen::Vector3d(0.0, 0.0, 8.0)}, landmark);
  };
  EXPECT_TRUE(from(55.0).has_value());
  EXPECT_FALSE(from(65.0).has_value());
  EXPECT_NEAR(from(30.0)->cos_angle, std::cos(M_PI / 6.0), 1e-9);
}

FeatureFrame OneKeypoint(SensorType sensor, int level) {
  FeatureFrame features;
  features.calibration = kCamera;
  features.calibration.sensor = sensor;
  features.keypoints = {Keypoint{.x_px = 320.0F, .y_px = 240.0F, .level = static_cast<uint8_t>(level)}};
  return features;
}

double SigmaFrom(const Eigen::Vector3d& camera_in_world, const FeatureFrame& features) {
  return SeenAt(features, 0, SeenFromOrigin({0.0, 0.0, 5.0}), camera_in_world).sigma_px;
}

TEST(SeenAt, ALandmarkFromWhereItWasSeenBeforeIsAsExactAsItsKeypoint) {
  const FeatureFrame features = OneKeypoint(SensorType::kStereo, 3);
  EXPECT_DOUBLE_EQ(SigmaFrom({0.0, 0.0, 2.0}, features), SeenAt(features, 0).sigma_px);
}

TEST(SeenAt, ALandmarkSeenFromAsideIsLessExactByItsAngleAndLevel) {
  for (const int level : {0, 2}) {
    const FeatureFrame features = OneKeypoint(SensorType::kStereo, level);
    const Eigen::Vector3d aside(5.0 * std::sin(0.4), 0.0, 5.0 - 5.0 * std::cos(0.4));
    const double chord = 2.0 * std::sin(0.2);
    const double expected = LevelScale(level) * std::hypot(KeypointSigmaPx(SensorType::kStereo),
                                                           AsideSigmaPxPerRad(SensorType::kStereo) * chord);
    EXPECT_NEAR(SigmaFrom(aside, features), expected, 1e-12) << level;
    EXPECT_GT(expected, 1.3 * SeenAt(features, 0).sigma_px);
  }
}

TEST(SeenAt, MonoKeepsOneNoise) {
  const FeatureFrame features = OneKeypoint(SensorType::kMono, 0);
  EXPECT_DOUBLE_EQ(SigmaFrom({3.0, 0.0, 1.0}, features), SeenAt(features, 0).sigma_px);
}

TEST(RollBetween, IsTheTurnAboutTheOpticalAxis) {
  const auto roll = [](double degrees) {
    return RollBetween({ExpSO3({0.0, 0.0, degrees * M_PI / 180.0}), Eigen::Vector3d::Zero()});
  };
  EXPECT_EQ(roll(0.0), 0);
  EXPECT_EQ(roll(90.0), 64);
  EXPECT_EQ(roll(-90.0), 192);
  EXPECT_EQ(RollBetween({ExpSO3({0.0, 0.3, 0.0}), {1.0, 2.0, 3.0}}), 0) << "looking aside is no roll";
}

TEST(MedianDepth, IsOneWithoutLandmarks) { EXPECT_EQ(MedianDepth(Map(), Keyframe()), 1.0); }

}  // namespace
}  // namespace tessera
