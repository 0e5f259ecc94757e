#include "geometry/reprojection.h"

#include <gtest/gtest.h>

#include "support/synthetic_views.h"

namespace tessera {
namespace {

TEST(HuberLoss, IsSquaredBelowTheCornerAndGrowsLikeTheResidualAbove) {
  EXPECT_EQ(HuberLoss(3.0, 4.0), 3.0);
  EXPECT_EQ(HuberLoss(100.0, 4.0), 2.0 * 2.0 * 10.0 - 4.0);
  for (const double squared : {1.0, 3.9, 4.1, 50.0}) {
    const double slope = (HuberLoss(squared + 1e-6, 4.0) - HuberLoss(squared - 1e-6, 4.0)) / 2e-6;
    EXPECT_NEAR(HuberWeight(squared, 4.0), slope, 1e-6) << squared;
  }
}

TEST(Reproject, JacobianIsTheNumericOne) {
  const CameraCalibration camera = MakeCamera();
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  for (const bool has_right : {false, true}) {
    PixelObservation seen = SeePoint(point + Eigen::Vector3d(0.1, 0.1, 0.3), has_right);
    const Reprojection analytic = Reproject(camera, kViewBaseline, point, seen);
    EXPECT_EQ(analytic.residual, ReprojectionResidual(camera, kViewBaseline, point, seen));
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-5 * Eigen::Vector3d::Unit(axis);
      const Eigen::Vector3d numeric = (ReprojectionResidual(camera, kViewBaseline, point + step, seen) -
                                       ReprojectionResidual(camera, kViewBaseline, point - step, seen)) /
                                      2e-5;
      EXPECT_LT((analytic.by_point.col(axis) - numeric).norm(), 1e-6) << axis;
    }
    EXPECT_EQ(analytic.by_point.row(2).isZero(0.0), !has_right);
  }
}

}  // namespace
}  // namespace tessera
