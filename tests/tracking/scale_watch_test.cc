// What the images leave open of the scale.
#include "tracking/scale_watch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

constexpr int64_t kSecond = 1'000'000;

// A step of two meters ahead, known to the share `sigma` along it and hardly across.
void AddStep(ScaleWatch& watch, int64_t utime_us, double sigma) {
  watch.Add(KeyframeId{utime_us / kSecond}, utime_us, {0.0, 0.0, 2.0},
            Eigen::Vector3d(9.0, 9.0, 4.0 * sigma * sigma).asDiagonal(), 0.0);
}

// One that is far below its own error.
void Stand(ScaleWatch& watch, int64_t utime_us, double known_share) {
  watch.Add(KeyframeId{utime_us / kSecond}, utime_us, {0.0, 0.0, 0.01}, 0.0009 * Eigen::Matrix3d::Identity(),
            known_share);
}

TEST(ScaleWatch, ErrorsAlongTheStepsAddUpInTheLogarithm) {
  ScaleWatch watch;
  EXPECT_EQ(watch.drift(), 0.0);
  AddStep(watch, kSecond, 0.3);
  EXPECT_NEAR(watch.drift(), 0.3, 1e-12);
  AddStep(watch, 2 * kSecond, 0.4);
  EXPECT_NEAR(watch.drift(), 0.5, 1e-12);
}

TEST(ScaleWatch, RecentAreTheLastSecondsOnly) {
  ScaleWatch watch;
  AddStep(watch, kSecond, 0.3);
  AddStep(watch, 3 * kSecond, 0.4);
  EXPECT_NEAR(watch.RecentDrift(3 * kSecond), 0.5, 1e-12);
  EXPECT_NEAR(watch.RecentDrift(6 * kSecond), 0.4, 1e-12);
  EXPECT_EQ(watch.RecentDrift(8 * kSecond), 0.0);
  AddStep(watch, 9 * kSecond, 0.1);
  EXPECT_NEAR(watch.RecentDrift(9 * kSecond), 0.1, 1e-12);
  EXPECT_NEAR(watch.drift(), std::sqrt(0.26), 1e-12);
}

TEST(ScaleWatch, ANewPartHasAScaleOfItsOwn) {
  ScaleWatch watch;
  AddStep(watch, kSecond, 0.3);
  watch.Restart();
  EXPECT_EQ(watch.drift(), 0.0);
  EXPECT_EQ(watch.RecentDrift(kSecond), 0.0);
}

TEST(ScaleWatch, ACameraThatStandsStillTellsNothing) {
  ScaleWatch watch;
  watch.Add(KeyframeId{1}, kSecond, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), 0.0);
  EXPECT_EQ(watch.drift(), 0.0);
}

// A bus passes: keyframe after keyframe is made of one place.
TEST(ScaleWatch, AStandingCamerasKeyframesDontCountWhileItsPointsHold) {
  ScaleWatch watch;
  AddStep(watch, kSecond, 0.3);
  for (int64_t second = 2; second < 8; ++second) Stand(watch, second * kSecond, 0.6);
  EXPECT_NEAR(watch.drift(), 0.3, 1e-12);
  EXPECT_EQ(watch.since(), KeyframeId{1}) << "where the next step begins";
  AddStep(watch, 8 * kSecond, 0.4);
  EXPECT_NEAR(watch.drift(), 0.5, 1e-12);
  EXPECT_EQ(watch.since(), KeyframeId{8});
}

// An open road: what held the scale is gone, and the steps shrink.
TEST(ScaleWatch, AnOpenStepCountsWhereItsPointsAreNew) {
  ScaleWatch watch;
  AddStep(watch, kSecond, 0.3);
  Stand(watch, 2 * kSecond, 0.4);
  EXPECT_GT(watch.drift(), 2.0);
  EXPECT_EQ(watch.since(), KeyframeId{2});
}

TEST(ScaleWatch, WhereTheCameraIsFoundTheNextStepBegins) {
  ScaleWatch watch;
  AddStep(watch, kSecond, 0.3);
  watch.GoOnFrom(KeyframeId{0});
  EXPECT_EQ(watch.since(), KeyframeId{0});
  EXPECT_NEAR(watch.drift(), 0.3, 1e-12);
}

}  // namespace
}  // namespace tessera
