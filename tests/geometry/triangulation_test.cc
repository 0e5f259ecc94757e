#include "geometry/triangulation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/matchers.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

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
  const auto found = PointFromDisparity(MakeCamera(), kViewBaseline, SeePoint(point, true));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - point).norm(), 1e-9);
  EXPECT_FALSE(PointFromDisparity(MakeCamera(), kViewBaseline, SeePoint(point, false)).has_value());
}

TEST(RefinePoint, RecoversAPointFromAWrongStart) {
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  std::vector<PointView> views;
  for (int i = 0; i < 4; ++i) {
    const Rigid3 camera_from_world{ExpSO3({0.0, 0.02 * i, 0.0}), {-0.3 * i, 0.05 * i, -0.2 * i}};
    views.push_back({camera_from_world, SeePoint(camera_from_world * point, i == 2)});
  }
  const auto refined = RefinePoint(MakeCamera(), kViewBaseline, views, point + Eigen::Vector3d(0.3, -0.2, 1.5), 20);
  ASSERT_TRUE(refined.has_value());
  EXPECT_LT((refined->point_in_world - point).norm(), 1e-6);
  EXPECT_LT(refined->max_chi2, 1e-8);
}

TEST(RefinePoint, NamesTheViewThatAgreesLeast) {
  const Eigen::Vector3d point(0.5, 0.2, 5.0);
  std::vector<PointView> views;
  for (int i = 0; i < 5; ++i) {
    const Rigid3 camera_from_world{Eigen::Quaterniond::Identity(), {-0.4 * i, 0.0, 0.0}};
    views.push_back({camera_from_world, SeePoint(camera_from_world * point, false)});
  }
  views[3].seen.pixel_px.y() += 30.0;
  const auto refined = RefinePoint(MakeCamera(), 0.0, views, point);
  ASSERT_TRUE(refined.has_value());
  EXPECT_EQ(refined->worst_view, 3);
  EXPECT_GT(refined->max_chi2, Chi2Limit(false));
}

TEST(RefinePoint, NothingWhereAViewHasThePointBehind) {
  const Eigen::Vector3d point(0.5, 0.2, 5.0);
  const PointView front{Rigid3(), SeePoint(point, false)};
  const PointView behind{{Eigen::Quaterniond::Identity(), {0.0, 0.0, -8.0}}, SeePoint(point, false)};
  EXPECT_FALSE(RefinePoint(MakeCamera(), 0.0, std::vector{front, behind}, point).has_value());
}

TEST(CosParallax, IsThatOfTheAngleAtThePoint) {
  EXPECT_NEAR(CosParallax({0.0, 0.0, 2.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}), 1.0, 1e-12);
  EXPECT_NEAR(CosParallax({0.0, 0.0, 1.0}, {-1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}), 0.0, 1e-12);
  EXPECT_NEAR(CosParallax({0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}), std::sqrt(0.5), 1e-12);
}

}  // namespace
}  // namespace tessera
