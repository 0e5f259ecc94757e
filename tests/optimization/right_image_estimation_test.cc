#include "optimization/right_image_estimation.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "support/synthetic_problems.h"

namespace tessera {
namespace {

// All of it in the image: beside it, x^2 is no small thing.
BundleProblem Stereo() {
  SyntheticBundleOptions options{.num_poses = 15,
                                 .num_points = 1500,
                                 .track_length = 8,
                                 .num_fixed = 1,
                                 .share_with_right = 1.0,
                                 .pixel_noise_px = 0.5,
                                 .pose_error = 0.001,
                                 .point_error_m = 0.01};
  BundleProblem problem = MakeSyntheticBundle(options).problem;
  const CameraCalibration& camera = problem.calibration;
  std::erase_if(problem.observations, [&](const BundleObservation& observation) {
    const Eigen::Vector2d& pixel = observation.seen.pixel_px;
    return pixel.x() < 0.0 || pixel.y() < -200.0 || pixel.x() > camera.width_px || pixel.y() > camera.height_px + 200.0;
  });
  for (BundleObservation& observation : problem.observations) observation.seen.sigma_px = 0.5;
  return problem;
}

Eigen::Vector4d Solve(const RightShiftEquations& equations) {
  return equations.information.inverse() * equations.right_side;
}

TEST(RightImageEstimation, FindsByHowMuchColumnsStandBeside) {
  const Eigen::Vector4d before = Solve(*EquationsOfRightShift(Stereo()));
  const std::optional<RightShiftEquations> wrong =
      EquationsOfRightShift(WithRightShift(Stereo(), {.center_px = 0.4, .down_px = -0.2}));
  ASSERT_TRUE(wrong);
  const Eigen::Vector4d found = Solve(*wrong);
  // The same noise is in both.
  EXPECT_NEAR(found[0] - before[0], -0.4, 0.06);
  EXPECT_NEAR(found[2] - before[2], 0.2, 0.08);
  for (int k = 0; k < 4; ++k) {
    EXPECT_LT(std::abs(before[k]), 4.0 * std::sqrt(wrong->information.inverse()(k, k))) << "nothing is wrong";
  }
}

TEST(RightImageEstimation, MovesRightColumnsAndSaysSo) {
  const BundleProblem problem = Stereo();
  const BundleProblem moved = WithRightShift(WithRightShift(problem, {.center_px = 1.0}), {.across_px = 2.0});
  EXPECT_EQ(moved.calibration.right_shift, (RightShift{.center_px = 1.0, .across_px = 2.0}));
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const PixelObservation &seen = problem.observations[i].seen, &then = moved.observations[i].seen;
    EXPECT_NEAR(then.right_x_px - seen.right_x_px, RightShiftAt(moved.calibration, seen.pixel_px), 1e-9);
    EXPECT_EQ(then.pixel_px, seen.pixel_px);
  }
}

TEST(RightImageEstimation, NothingToSeeIsNothingFound) { EXPECT_FALSE(EquationsOfRightShift({})); }

}  // namespace
}  // namespace tessera
