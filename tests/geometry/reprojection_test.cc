#include "geometry/reprojection.h"

#include <gtest/gtest.h>

#include "geometry/pose_optimization.h"
#include "geometry/rigid3.h"
#include "geometry/triangulation.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

constexpr double kBaseline = 0.5;

PixelObservation See(const Eigen::Vector3d& point_in_camera, bool has_right) {
  const CameraCalibration camera = MakeCamera();
  PixelObservation seen{camera.Project(point_in_camera), kNoColumn, 1.3};
  if (has_right) seen.right_x_px = seen.pixel_px.x() - camera.fx_px * kBaseline / point_in_camera.z();
  return seen;
}

TEST(Reproject, JacobianIsTheNumericOne) {
  const CameraCalibration camera = MakeCamera();
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  for (const bool has_right : {false, true}) {
    PixelObservation seen = See(point + Eigen::Vector3d(0.1, 0.1, 0.3), has_right);
    const Reprojection analytic = Reproject(camera, kBaseline, point, seen);
    EXPECT_EQ(analytic.residual, ReprojectionResidual(camera, kBaseline, point, seen));
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector3d numeric = (ReprojectionResidual(camera, kBaseline, point + step, seen) -
                                       ReprojectionResidual(camera, kBaseline, point - step, seen)) /
                                      2e-5;
      EXPECT_LT((analytic.by_point.col(axis) - numeric).norm(), 1e-6) << axis;
    }
    EXPECT_EQ(analytic.by_point.row(2).isZero(0.0), !has_right);
  }
}

TEST(TriangulateRays, FindsThePoint) {
  const CameraCalibration camera = MakeCamera();
  const Rigid3 motion{ExpSO3({0.01, -0.05, 0.02}), {-1.2, 0.1, 0.1}};
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, motion, 50)) {
    const auto found =
        TriangulateRays(motion, camera.Ray(camera.Project(point)), camera.Ray(camera.Project(motion * point)));
    ASSERT_TRUE(found.has_value());
    EXPECT_LT((*found - point).norm(), 1e-6);
  }
  EXPECT_FALSE(TriangulateRays({}, {0.1, 0.2, 1.0}, {0.1, 0.2, 1.0}).has_value());
}

TEST(PointFromDisparity, InvertsTheProjection) {
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  const auto found = PointFromDisparity(MakeCamera(), kBaseline, See(point, true));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - point).norm(), 1e-9);
  EXPECT_FALSE(PointFromDisparity(MakeCamera(), kBaseline, See(point, false)).has_value());
}

TEST(RefinePoint, RecoversAPointFromAWrongStart) {
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  std::vector<PointView> views;
  for (int i = 0; i < 4; ++i) {
    const Rigid3 camera_from_world{ExpSO3({0.0, 0.02 * i, 0.0}), {-0.3 * i, 0.05 * i, -0.2 * i}};
    views.push_back({camera_from_world, See(camera_from_world * point, i == 2)});
  }
  const auto refined = RefinePoint(MakeCamera(), kBaseline, views, point + Eigen::Vector3d(0.3, -0.2, 1.5), 20);
  ASSERT_TRUE(refined.has_value());
  EXPECT_LT((refined->point_in_world - point).norm(), 1e-6);
  EXPECT_LT(refined->max_chi2, 1e-8);
}

class OptimizePoseTest : public testing::TestWithParam<bool> {};

// A synthetic world without noise is met to 1e-6, whatever share of wrong matches stands in it.
TEST_P(OptimizePoseTest, RecoversThePoseAndNamesTheOutliers) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const auto points = MakePoints(Scene::kGeneral, truth, 200);
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    observations.push_back({points[i], See(truth * points[i], GetParam() && i % 3 > 0)});
    if (i % 5 == 0) observations.back().seen.pixel_px += Eigen::Vector2d(25.0, -40.0);
  }
  Eigen::Matrix<double, 6, 1> error;
  error << 0.1, -0.05, 0.1, 0.01, -0.02, 0.01;
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kBaseline, observations, Retract(truth, error), {});
  EXPECT_LT((result.camera_from_world.translation - truth.translation).norm(), 1e-6);
  EXPECT_LT(result.camera_from_world.rotation.angularDistance(truth.rotation), 1e-6);
  EXPECT_EQ(result.num_inliers, 160);
  for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(result.is_inlier[i] != 0, i % 5 != 0) << i;
}

INSTANTIATE_TEST_SUITE_P(MonoAndStereo, OptimizePoseTest, testing::Bool());

TEST(OptimizePose, InformationIsTheCurvatureOfTheCost) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  std::vector<PoseObservation> observations;
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, truth, 100)) {
    observations.push_back({point, See(truth * point, true)});
  }
  const auto cost = [&](const Eigen::Matrix<double, 6, 1>& delta) {
    double sum = 0.0;
    for (const PoseObservation& o : observations) {
      sum +=
          ReprojectionResidual(MakeCamera(), kBaseline, Retract(truth, delta) * o.point_in_world, o.seen).squaredNorm();
    }
    return 0.5 * sum;
  };
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kBaseline, observations, truth, {});
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
