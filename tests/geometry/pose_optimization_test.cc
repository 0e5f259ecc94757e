#include "geometry/pose_optimization.h"

#include <gtest/gtest.h>

#include "support/matchers.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

class OptimizePoseTest : public testing::TestWithParam<bool> {};

// A synthetic world without noise is met to 1e-6, whatever share of wrong matches stands in it.
TEST_P(OptimizePoseTest, RecoversThePoseAndNamesTheOutliers) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const auto points = MakePoints(Scene::kGeneral, truth, 200);
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    observations.push_back({points[i], SeePoint(truth * points[i], GetParam() && i % 3 > 0)});
    if (i % 5 == 0) observations.back().seen.pixel_px += Eigen::Vector2d(25.0, -40.0);
  }
  Eigen::Matrix<double, 6, 1> error;
  error << 0.1, -0.05, 0.1, 0.01, -0.02, 0.01;
  const PoseOptimizationResult result =
      OptimizePose(MakeCamera(), kViewBaseline, observations, Retract(truth, error), {});
  EXPECT_THAT(result.camera_from_world, IsNear(truth, 1e-6));
  EXPECT_EQ(result.num_inliers, 160);
  for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(result.is_inlier[i] != 0, i % 5 != 0) << i;
}

INSTANTIATE_TEST_SUITE_P(MonoAndStereo, OptimizePoseTest, testing::Bool());

TEST(OptimizePose, InformationIsTheCurvatureOfTheCost) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  std::vector<PoseObservation> observations;
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, truth, 100)) {
    observations.push_back({point, SeePoint(truth * point, true)});
  }
  const auto cost = [&](const Eigen::Matrix<double, 6, 1>& delta) {
    double sum = 0.0;
    for (const PoseObservation& o : observations) {
      sum += ReprojectionResidual(MakeCamera(), kViewBaseline, Retract(truth, delta) * o.point_in_world, o.seen)
                 .squaredNorm();
    }
    return 0.5 * sum;
  };
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kViewBaseline, observations, truth, {});
  for (int axis = 0; axis < 6; ++axis) {
    const Eigen::Matrix<double, 6, 1> step = 1e-4 * Eigen::Matrix<double, 6, 1>::Unit(axis);
    const double curvature = (cost(step) + cost(-step) - 2.0 * cost(step - step)) / 1e-8;
    EXPECT_NEAR(curvature / result.information(axis, axis), 1.0, 1e-3) << axis;
  }
}

TEST(OptimizePose, TooFewPointsLeaveThePose) {
  const Rigid3 guess{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), 0.0, {}, guess, {});
  EXPECT_EQ(result.num_inliers, 0);
  EXPECT_EQ(result.camera_from_world.translation, guess.translation);
}

}  // namespace
}  // namespace tessera
