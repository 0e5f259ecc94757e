// What the images leave open of the scale.
#include "tracking/scale_watch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

constexpr int64_t kSecond = 1'000'000;

// A step of two meters ahead, known to the share `sigma` along it and hardly across.
void AddStep(ScaleWatch& watch, int64_t utime_us, double sigma) {
  watch.Add(utime_us, {0.0, 0.0, 2.0}, Eigen::Vector3d(9.0, 9.0, 4.0 * sigma * sigma).asDiagonal());
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
  watch.Add(kSecond, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
  EXPECT_EQ(watch.drift(), 0.0);
}

}  // namespace
}  // namespace tessera
