#include "optimization/focal_estimation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/synthetic_problems.h"

namespace tessera {
namespace {

// A camera that turns by half a radian in all.
SyntheticBundleOptions Turning() {
  return {.num_poses = 25,
          .num_points = 1200,
          .track_length = 10,
          .num_fixed = 1,
          .pixel_noise_px = 0.7,
          .pose_error = 0.001,
          .point_error_m = 0.01};
}

BundleProblem ProblemOf(const SyntheticBundleOptions& options, double focal_error) {
  BundleProblem problem = MakeSyntheticBundle(options).problem;
  problem.scale_pose = 5;
  for (BundleObservation& observation : problem.observations) observation.seen.sigma_px = 0.7;
  problem.calibration = WithFocal(problem.calibration, ScaledFocal(problem.calibration, focal_error));
  return problem;
}

TEST(FocalEstimation, FindsByHowMuchTheFocalLengthsAreWrong) {
  for (const double error : {-0.015, 0.0}) {
    const std::optional<FocalEstimate> estimate = EstimateFocal(ProblemOf(Turning(), error));
    ASSERT_TRUE(estimate);
    EXPECT_LT(estimate->sigma, 0.004);
    const double left = (1.0 + error) * (1.0 + estimate->error) - 1.0;
    // The costs are no parabola where an error makes outliers: a second estimate from there would be nearer.
    EXPECT_LT(std::abs(left), std::max(3.0 * estimate->sigma, 0.2 * std::abs(error))) << error;
  }
}

TEST(FocalEstimation, ScalesBothFocalLengthsAlike) {
  const FocalLengths focal = ScaledFocal(SyntheticCamera(), -0.01);
  EXPECT_DOUBLE_EQ(focal.fx_px, 0.99 * 718.0);
  EXPECT_DOUBLE_EQ(focal.fy_px, 0.99 * 715.0);
}

TEST(FocalEstimation, KnowsMoreByMorePoints) {
  SyntheticBundleOptions some = Turning();
  some.num_points /= 4;
  const std::optional<FocalEstimate> little = EstimateFocal(ProblemOf(some, 0.0));
  const std::optional<FocalEstimate> much = EstimateFocal(ProblemOf(Turning(), 0.0));
  ASSERT_TRUE(little && much);
  EXPECT_NEAR(little->sigma / much->sigma, 2.0, 0.6);
}

TEST(FocalEstimation, IsNoneWithoutPoints) {
  BundleProblem problem = ProblemOf(Turning(), 0.0);
  problem.points.clear();
  problem.observations.clear();
  EXPECT_FALSE(EstimateFocal(problem));
}

}  // namespace
}  // namespace tessera
