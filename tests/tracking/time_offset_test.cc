#include "tracking/time_offset.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera {
namespace {

constexpr double kOffset_s = 0.02;

// Residuals of points in a frame whose pose is wrong by a random twist, and whose time by `error_s`.
TimeOffsetEquations FrameWith(double error_s, int num_points, std::mt19937& random) {
  std::normal_distribution<double> gaussian;
  TimeOffsetEquations equations;
  Eigen::Matrix<double, 6, 1> pose_error;
  for (double& value : pose_error) value = 0.001 * gaussian(random);
  for (int i = 0; i < num_points; ++i) {
    Eigen::Matrix<double, 3, 6> by_pose;
    for (double& value : by_pose.reshaped()) value = 100.0 * gaussian(random);
    Eigen::Vector3d by_offset, noise;
    for (double& value : by_offset) value = 200.0 * gaussian(random);
    for (double& value : noise) value = gaussian(random);
    equations.Add(by_pose * pose_error + by_offset * error_s + noise, by_pose, by_offset, 3);
  }
  return equations;
}

TEST(TimeOffset, OneFrameTellsTheErrorAndHowExactly) {
  std::mt19937 random(3);
  double sum_of_squares = 0.0;
  for (int i = 0; i < 200; ++i) {
    const std::optional<TimeOffsetEquations::Error> error = FrameWith(0.001, 100, random).Solve();
    ASSERT_TRUE(error);
    sum_of_squares += (error->seconds - 0.001) * (error->seconds - 0.001) / error->variance;
  }
  EXPECT_NEAR(sum_of_squares / 200.0, 1.0, 0.25);
}

TEST(TimeOffset, TooFewPointsTellNothing) {
  std::mt19937 random(3);
  EXPECT_FALSE(FrameWith(kOffset_s, 30, random).Solve());
  EXPECT_FALSE(TimeOffsetEquations().Solve());
}

TEST(TimeOffset, PointsThatDontDependOnItTellNothing) {
  TimeOffsetEquations equations;
  for (int i = 0; i < 100; ++i) {
    equations.Add(Eigen::Vector3d::Ones(), Eigen::Matrix<double, 3, 6>::Random(), Eigen::Vector3d::Zero(), 2);
  }
  EXPECT_FALSE(equations.Solve());
}

TEST(TimeOffset, IsLearnedFromFrameToFrameWithEitherSign) {
  std::mt19937 random(3);
  for (const double offset_s : {kOffset_s, -kOffset_s}) {
    TimeOffset learned;
    for (int i = 0; i < 100; ++i) {
      const double used_s = learned.value_s(0.002);
      learned.Add(FrameWith(offset_s - used_s, 100, random), used_s);
    }
    EXPECT_NEAR(learned.value_s(0.002), offset_s, 0.001);
    EXPECT_EQ(learned.value_s(0.03), 0.0) << "shorter than what matters";
  }
}

// A standard deviation of 1 for noise, 1 for the offset, and 0.245 for the pose.
TEST(TimeOffset, TellsHowMuchOfTheResidualsItExplains) {
  std::mt19937 random(3);
  TimeOffset shown, none;
  EXPECT_EQ(none.ExplainedShare(), 0.0);
  for (int i = 0; i < 100; ++i) {
    shown.Add(FrameWith(0.005, 100, random), 0.0);
    none.Add(FrameWith(0.0, 100, random), 0.0);
  }
  EXPECT_NEAR(shown.ExplainedShare(), 1.0 / 2.06, 0.02);
  EXPECT_LT(none.ExplainedShare(), 0.001);
  EXPECT_EQ(none.num_frames(), 100);
}

}  // namespace
}  // namespace tessera
