#include "geometry/reprojection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

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
  for (const auto& [has_right, disparity_sigma_px] :
       {std::pair(false, 0.0), std::pair(true, 0.0), std::pair(true, 0.2)}) {
    PixelObservation seen = SeePoint(point + Eigen::Vector3d(0.1, 0.1, 0.3), has_right);
    seen.disparity_sigma_px = disparity_sigma_px;
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

// A stereo pair finds a column: its error is the pixel's, and so is the shift of both. A depth sensor measures the
// disparity by itself: where the left column is wrong, the disparity is not.
TEST(Reproject, ADepthSensorsDisparityIsAResidualOfItsOwn) {
  const CameraCalibration camera = MakeCamera();
  const Eigen::Vector3d point(1.5, -0.7, 6.0);
  PixelObservation stereo = SeePoint(point, true);
  stereo.pixel_px.x() += 2.0;
  stereo.right_x_px += 2.0;
  PixelObservation sensor = stereo;
  sensor.disparity_sigma_px = 0.2;
  const double shift = -2.0 / stereo.sigma_px;
  EXPECT_LT((ReprojectionResidual(camera, kViewBaseline, point, stereo) - Eigen::Vector3d(shift, 0, shift)).norm(),
            1e-9);
  EXPECT_LT((ReprojectionResidual(camera, kViewBaseline, point, sensor) - Eigen::Vector3d(shift, 0, 0)).norm(), 1e-9);
  // A disparity that is wrong by its own sigma has a residual of 1, whatever the pixel's sigma.
  sensor.right_x_px += 0.2;
  sensor.sigma_px = 4.0;
  EXPECT_NEAR(std::abs(ReprojectionResidual(camera, kViewBaseline, point, sensor).z()), 1.0, 1e-9);
  // Without a measured disparity its sigma means nothing.
  sensor.right_x_px = kNoColumn;
  EXPECT_EQ(Reproject(camera, kViewBaseline, point, sensor).residual.z(), 0.0);
  EXPECT_TRUE(Reproject(camera, kViewBaseline, point, sensor).by_point.row(2).isZero(0.0));
}

}  // namespace
}  // namespace tessera
