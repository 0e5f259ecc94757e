// Keypoints of a lens that turns out to distort.
#include <gtest/gtest.h>

#include "features/feature_types.h"

namespace tessera {
namespace {

CameraCalibration Camera() {
  return {.width_px = 640, .height_px = 480, .fx_px = 500.0, .fy_px = 490.0, .cx_px = 321.5, .cy_px = 239.0};
}

TEST(Lens, MovesTheEdgeByThatShareAndTheCenterNot) {
  const CameraCalibration camera = Camera();
  EXPECT_NEAR(MovedByLens(camera, -0.01, {321.5 + 320.0, 239.0}).x(), 321.5 + 0.99 * 320.0, 1e-9);
  EXPECT_NEAR(MovedByLens(camera, -0.01, {321.5, 239.0 + 160.0}).y(), 239.0 + 160.0 * (1.0 - 0.0025), 1e-9);
  EXPECT_EQ(MovedByLens(camera, 0.02, {321.5, 239.0}), Eigen::Vector2d(321.5, 239.0));
}

TEST(Lens, WhatWasMovedComesBack) {
  const CameraCalibration camera = Camera();
  for (const double radial : {-kMaxRadial, 0.0, 0.004, kMaxRadial}) {
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(0, 0), Eigen::Vector2d(639, 479), Eigen::Vector2d(300, 10)}) {
      EXPECT_LT((BeforeLens(camera, radial, MovedByLens(camera, radial, pixel)) - pixel).norm(), 1e-6);
    }
  }
}

TEST(Lens, FeaturesSayWhereTheyWereMoved) {
  FeatureFrame seen;
  seen.calibration = Camera();
  seen.keypoints = {{.x_px = 10.0F, .y_px = 20.0F}, {.x_px = 600.0F, .y_px = 400.0F}};
  const FeatureFrame moved = WithLens(seen, {480.0, 470.0, 0.01});
  EXPECT_EQ(moved.calibration, WithLens(Camera(), {480.0, 470.0, 0.01}));
  EXPECT_LT(moved.keypoints[0].x_px, 9.0F);
  EXPECT_GT(moved.keypoints[1].x_px, 601.0F);
  // From one lens to another as if it had been the other at once.
  const FeatureFrame again = WithLens(moved, {490.0, 480.0, -0.006}), at_once = WithLens(seen, {490.0, 480.0, -0.006});
  EXPECT_EQ(again.calibration, at_once.calibration);
  for (size_t i = 0; i < seen.keypoints.size(); ++i) {
    EXPECT_NEAR(again.keypoints[i].x_px, at_once.keypoints[i].x_px, 1e-4);
    EXPECT_NEAR(again.keypoints[i].y_px, at_once.keypoints[i].y_px, 1e-4);
  }
  // No correction, or one of the focal lengths alone: not a bit of a keypoint changes.
  EXPECT_EQ(WithLens(seen, {}).keypoints, seen.keypoints);
  EXPECT_EQ(WithLens(seen, {}).calibration, seen.calibration);
  EXPECT_EQ(WithLens(seen, {480.0, 470.0, 0.0}).keypoints, seen.keypoints);
  EXPECT_EQ(WithLens(moved, {490.0, 480.0, 0.01}).keypoints, moved.keypoints);
}

TEST(Lens, RightColumnsAreMovedAndComeBack) {
  FeatureFrame seen;
  seen.calibration = Camera();
  seen.calibration.sensor = SensorType::kStereo;
  // At the center, half a width to the right of it, half a width below it (not in the image), and without a match.
  seen.keypoints = {{.x_px = 321.5F, .y_px = 239.0F, .right_x_px = 300.0F},
                    {.x_px = 641.5F, .y_px = 239.0F, .right_x_px = 600.0F},
                    {.x_px = 321.5F, .y_px = 559.0F, .right_x_px = 300.0F},
                    {.x_px = 321.5F, .y_px = 239.0F}};
  LensCorrection lens{500.0, 490.0, 0.0, {.center_px = 1.0, .across_px = 0.25, .down_px = -0.5, .bend_px = 2.0}};
  const FeatureFrame moved = WithLens(seen, lens);
  EXPECT_EQ(moved.calibration.right_shift, lens.right_shift);
  EXPECT_NEAR(moved.keypoints[0].right_x_px, 301.0, 1e-4);
  EXPECT_NEAR(moved.keypoints[1].right_x_px, 603.25, 1e-4);
  EXPECT_NEAR(moved.keypoints[2].right_x_px, 300.5, 1e-4);
  EXPECT_EQ(moved.keypoints[3], seen.keypoints[3]);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(moved.keypoints[i].x_px, seen.keypoints[i].x_px);
  EXPECT_EQ(WithLens(moved, lens).keypoints, moved.keypoints);
  lens.right_shift = {};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(WithLens(moved, lens).keypoints[i].right_x_px, seen.keypoints[i].right_x_px, 1e-4);
  }
}

}  // namespace
}  // namespace tessera
