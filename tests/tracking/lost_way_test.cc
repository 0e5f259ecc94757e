// The way of a lost camera, in the synthetic world.
#include "tracking/lost_way.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr double kInterval_s = 0.1;

class LostWayTest : public testing::Test {
 protected:
  std::shared_ptr<const FrameView> Take(int64_t step, const Rigid3& pose) {
    FeatureFrame features = world_.Take(step, pose).features;
    features.utime_us = 1'000'000 + step * 100'000;
    return ViewOf(features);
  }
  static Rigid3 Turned(double yaw_rad) { return {ExpSO3({0.0, yaw_rad, 0.0}), Eigen::Vector3d::Zero()}; }
  // `num_steps` steps of half a meter, each turned by yaw_rad(step).
  Rigid3 Go(int num_steps, const std::function<double(int)>& yaw_rad) {
    Rigid3 pose;
    for (int i = 1; i <= num_steps; ++i) {
      const Rigid3 half = Turned(0.5 * yaw_rad(i));
      pose = pose * half * Rigid3{Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.5}} * half;
      way_.Add(Take(i, pose));
    }
    return pose;
  }

  SyntheticWorld world_{SensorType::kMono, 0.3};
  LostWay way_;
};

TEST_F(LostWayTest, BeforeALossThereIsNone) {
  EXPECT_FALSE(way_.has_begun());
  EXPECT_THAT(way_.PoseAt(0), IsNear(Rigid3{}, 1e-12));
}

TEST_F(LostWayTest, TurnsAsTheFramesShowAndGoesOnAsFastAsItDid) {
  way_.Begin(Take(0, {}), {}, {0.0, 0.0, 0.5 / kInterval_s}, Eigen::Vector3d::Zero());
  EXPECT_NEAR(way_.speed(), 5.0, 1e-12);
  const Rigid3 truth = Go(12, [](int i) { return i < 6 ? 0.04 : -0.03; });
  const Rigid3 pose = way_.PoseAt(1'000'000 + 12 * 100'000);
  EXPECT_LT(pose.rotation.angularDistance(truth.rotation), 0.01);
  EXPECT_LT((pose.translation - truth.translation).norm(), 0.1);
}

TEST_F(LostWayTest, RemembersWhereItWas) {
  way_.Begin(Take(0, {}), {}, {0.0, 0.0, 5.0}, Eigen::Vector3d::Zero());
  Go(12, [](int) { return 0.0; });
  EXPECT_NEAR(way_.PoseAt(1'000'000).translation.z(), 0.0, 1e-9);
  EXPECT_NEAR(way_.PoseAt(1'500'000).translation.z(), 2.5, 0.05);
  EXPECT_NEAR(way_.PoseAt(1'549'999).translation.z(), 2.5, 0.05);
  way_.End();
  EXPECT_FALSE(way_.has_begun());
}

// A hand before the lens for two seconds, in a bend: for about one, the camera turns on.
TEST_F(LostWayTest, TurnsOnForAWhileIfItSeesNothing) {
  way_.Begin(Take(0, {}), {}, {0.0, 0.0, 5.0}, {0.0, 0.2, 0.0});
  for (int64_t step = 1; step <= 20; ++step) {
    FeatureFrame blind;
    blind.calibration = world_.calibration();
    blind.utime_us = 1'000'000 + step * 100'000;
    way_.Add(ViewOf(blind));
  }
  const double yaw_rad = LogSO3(way_.PoseAt(3'000'000).rotation).y();
  EXPECT_GT(yaw_rad, 0.12);
  EXPECT_LT(yaw_rad, 0.25);
}

// Without a way, frames tell nothing of where things are; and of one that stands, nothing moves.
TEST_F(LostWayTest, TurnsOnTheSpotAndStands) {
  way_.Begin(Take(0, {}), {}, Eigen::Vector3d::Zero(), {0.0, 0.3, 0.0});
  for (int i = 1; i <= 12; ++i) way_.Add(Take(i, Turned(0.03 * std::min(i, 6))));
  EXPECT_LT(way_.PoseAt(1'600'000).rotation.angularDistance(Turned(0.18).rotation), 0.01);
  EXPECT_LT(way_.PoseAt(2'200'000).rotation.angularDistance(Turned(0.18).rotation), 0.01);
  EXPECT_LT(way_.PoseAt(2'200'000).translation.norm(), 1e-9);
}

// By less than a pixel from frame to frame.
TEST_F(LostWayTest, TurnsSlowly) {
  way_.Begin(Take(0, {}), {}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  for (int i = 1; i <= 60; ++i) way_.Add(Take(i, Turned(0.0012 * i)));
  EXPECT_LT(way_.PoseAt(7'000'000).rotation.angularDistance(Turned(0.072).rotation), 0.015);
}

TEST_F(LostWayTest, AFrameOfTheSameTimeChangesNothing) {
  way_.Begin(Take(0, {}), {}, {0.0, 0.0, 5.0}, {0.0, 0.2, 0.0});
  way_.Add(Take(0, Turned(0.1)));
  EXPECT_THAT(way_.PoseAt(9'000'000), IsNear(Rigid3{}, 1e-12));
}

}  // namespace
}  // namespace tessera
