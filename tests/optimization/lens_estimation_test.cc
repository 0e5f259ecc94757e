#include "optimization/lens_estimation.h"

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

// Of a calibration that is wrong by `error`.
BundleProblem ProblemOf(const SyntheticBundleOptions& options, const LensError& error) {
  BundleProblem problem = MakeSyntheticBundle(options).problem;
  problem.scale_pose = 5;
  for (BundleObservation& observation : problem.observations) observation.seen.sigma_px = 0.7;
  return WithLensError(problem, error);
}

// Of many points, all of them in the image: beside it, a distortion is no small thing.
BundleProblem InImage(const LensError& error) {
  SyntheticBundleOptions many = Turning();
  many.num_points *= 3;
  BundleProblem problem = ProblemOf(many, {});
  const CameraCalibration& camera = problem.calibration;
  std::erase_if(problem.observations, [&](const BundleObservation& observation) {
    const Eigen::Vector2d& pixel = observation.seen.pixel_px;
    return pixel.x() < 0.0 || pixel.y() < -400.0 || pixel.x() > camera.width_px || pixel.y() > camera.height_px + 400.0;
  });
  return WithLensError(problem, error);
}

std::optional<FocalEstimate> FocalOf(const BundleProblem& problem) { return LensEstimator(problem).Focal(); }

TEST(FocalEstimation, FindsByHowMuchTheFocalLengthsAreWrong) {
  for (const double error : {-0.015, 0.0}) {
    const std::optional<FocalEstimate> estimate = FocalOf(ProblemOf(Turning(), {error, 0.0}));
    ASSERT_TRUE(estimate);
    EXPECT_LT(estimate->sigma, 0.004);
    const double left = (1.0 + error) * (1.0 + estimate->error) - 1.0;
    // The costs are no parabola where an error makes outliers: a second estimate from there would be nearer.
    EXPECT_LT(std::abs(left), std::max(3.0 * estimate->sigma, 0.2 * std::abs(error))) << error;
  }
}

TEST(LensEstimation, ScalesBothFocalLengthsAlike) {
  const LensCorrection lens = CorrectedBy({-0.01, 0.002}, SyntheticCamera());
  EXPECT_DOUBLE_EQ(lens.fx_px, 0.99 * 718.0);
  EXPECT_DOUBLE_EQ(lens.fy_px, 0.99 * 715.0);
  EXPECT_DOUBLE_EQ(lens.radial, 0.002);
}

TEST(LensEstimation, AnErrorAndItsOppositeLeaveTheProblemAsItWas) {
  const BundleProblem problem = InImage({});
  const LensError error{0.01, -0.008};
  const BundleProblem back = WithLensError(WithLensError(problem, error), {1.0 / 1.01 - 1.0, 0.008});
  EXPECT_NEAR(back.calibration.fx_px, problem.calibration.fx_px, 1e-9);
  EXPECT_NEAR(back.calibration.radial, 0.0, 1e-15);
  EXPECT_NEAR(back.observations[0].seen.sigma_px, problem.observations[0].seen.sigma_px, 1e-9);
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    EXPECT_LT((back.observations[i].seen.pixel_px - problem.observations[i].seen.pixel_px).norm(), 1e-6);
  }
}

// What a turn shows, one number of the two, is known; how it is made up lies between what images and priors say.
TEST(LensEstimation, FindsTheDistortionAndTheFocalLengthTogether) {
  for (const LensError& wrong : {LensError{0.0, 0.006}, LensError{0.015, 0.0}, LensError{0.01, 0.004}, LensError{}}) {
    const BundleProblem problem = InImage(wrong);
    const std::optional<LensError> found = LensEstimator(problem).Lens({});
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->focal, -wrong.focal, 0.006) << wrong.focal << ' ' << wrong.radial;
    EXPECT_NEAR(found->radial, -wrong.radial, 0.003) << wrong.focal << ' ' << wrong.radial;
    const std::optional<FocalEstimate> left = FocalOf(WithLensError(problem, *found));
    ASSERT_TRUE(left);
    EXPECT_LT(std::abs(left->error), std::max(0.004, 4.0 * left->sigma));
  }
}

TEST(LensEstimation, WhatIsKnownAlreadyMakesMoreOfTheSameLessLikely) {
  const BundleProblem problem = InImage({0.0, 0.006});
  LensEstimator estimator(problem);
  const std::optional<LensError> first = estimator.Lens({}), further = estimator.Lens({-0.01, -0.02});
  ASSERT_TRUE(first && further);
  EXPECT_GT(further->radial, first->radial);
}

TEST(FocalEstimation, KnowsMoreByMorePoints) {
  SyntheticBundleOptions some = Turning();
  some.num_points /= 4;
  const std::optional<FocalEstimate> little = FocalOf(ProblemOf(some, {}));
  const std::optional<FocalEstimate> much = FocalOf(ProblemOf(Turning(), {}));
  ASSERT_TRUE(little && much);
  EXPECT_NEAR(little->sigma / much->sigma, 2.0, 0.6);
}

TEST(LensEstimation, IsNoneWithoutPoints) {
  BundleProblem problem = ProblemOf(Turning(), {});
  problem.points.clear();
  problem.observations.clear();
  EXPECT_FALSE(FocalOf(problem));
  EXPECT_FALSE(LensEstimator(problem).Lens({}));
}

}  // namespace
}  // namespace tessera
