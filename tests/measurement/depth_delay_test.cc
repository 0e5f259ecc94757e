#include "measurement/depth_delay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/vga_camera.h"

namespace tessera {
namespace {

constexpr double kDelay_s = 0.015;
const CameraMotion kMotion{{0.3, -0.1, 0.2}, {0.4, 2.5, -0.3}};
const Eigen::Vector3d kTable(0.1, 0.3, 0.5);  // a . point = 1: a table that the camera looks down at

CameraCalibration Camera() { return VgaCamera(SensorType::kRgbd); }

FeatureFrame FrameOf(const std::vector<Keypoint>& keypoints) {
  FeatureFrame frame;
  frame.calibration = Camera();
  frame.keypoints = keypoints;
  frame.descriptors.resize(keypoints.size());
  return frame;
}

Keypoint KeypointAt(const Eigen::Vector2d& pixel_px, const Eigen::Vector3d& surface) {
  return {.x_px = static_cast<float>(pixel_px.x()),
          .y_px = static_cast<float>(pixel_px.y()),
          .depth_m = static_cast<float>(1.0 / surface.dot(Camera().Ray(pixel_px)))};
}

// A surface as the camera sees it `time_s` after the image, by its definition: of three of its points.
Eigen::Vector3d SeenLater(const Eigen::Vector3d& surface, double time_s) {
  const Rigid3 image_from_later{ExpSO3(time_s * kMotion.turn_rate), time_s * kMotion.velocity};
  Eigen::Matrix3d points;
  int row = 0;
  for (const Eigen::Vector2d& pixel_px :
       {Eigen::Vector2d(100, 300), Eigen::Vector2d(500, 200), Eigen::Vector2d(300, 450)}) {
    const Eigen::Vector3d ray = Camera().Ray(pixel_px);
    points.row(row++) = image_from_later.Inverse() * Eigen::Vector3d(ray / surface.dot(ray));
  }
  return points.inverse() * Eigen::Vector3d::Ones();
}

// Keypoints 10 px apart that see a surface.
std::vector<Keypoint> LatticeOn(const Eigen::Vector3d& surface) {
  std::vector<Keypoint> keypoints;
  for (int y = 40; y < 440; y += 10) {
    for (int x = 60; x < 580; x += 10) keypoints.push_back(KeypointAt(Eigen::Vector2d(x, y), surface));
  }
  return keypoints;
}

FeatureFrame Corrected(const std::vector<Keypoint>& keypoints, double delay_s) {
  const FrameView view(FrameOf(keypoints));
  return WithDepthsOfImage(view, SurfacesOf(view), delay_s, kMotion);
}

TEST(DepthDelay, DepthsAreThoseOfTheImageAgain) {
  for (const double delay_s : {kDelay_s, -kDelay_s}) {
    const std::vector<Keypoint> measured = LatticeOn(SeenLater(kTable, delay_s));
    const FeatureFrame corrected = Corrected(measured, delay_s);
    double largest_before = 0.0;
    for (size_t i = 0; i < measured.size(); ++i) {
      const Keypoint& keypoint = corrected.keypoints[i];
      const Keypoint expected = KeypointAt({keypoint.x_px, keypoint.y_px}, kTable);
      // Not exact: one keypoint's weight holds each slope towards none.
      EXPECT_NEAR(keypoint.depth_m, expected.depth_m, 0.002F * expected.depth_m);
      largest_before =
          std::max(largest_before, std::abs(1.0 - static_cast<double>(measured[i].depth_m / expected.depth_m)));
    }
    EXPECT_GT(largest_before, 0.02);
  }
}

TEST(DepthDelay, ASurfaceBehindAnEdgeBendsNothing) {
  const Eigen::Vector3d before = kTable, behind = 0.7 * kTable;
  std::vector<Keypoint> keypoints = LatticeOn(before);
  const std::vector<Keypoint> far = LatticeOn(behind);
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (keypoints[i].x_px > 300.0F) keypoints[i] = far[i];
  }
  const FrameView view(FrameOf(keypoints));
  for (int i = 0; i < view.size(); ++i) {
    const std::optional<Eigen::Vector3d> surface = SurfaceAt(view, i);
    ASSERT_TRUE(surface);
    const Eigen::Vector3d& truth = view.keypoint(i).x_px > 300.0F ? behind : before;
    EXPECT_LT((*surface - truth).norm(), 0.08 * truth.norm());
    EXPECT_NEAR(surface->dot(Camera().Ray(view.pixel(i))), 1.0 / static_cast<double>(view.keypoint(i).depth_m), 1e-9);
  }
}

TEST(DepthDelay, ADepthAloneIsKeptOnlyWhileTheCameraHardlyMoves) {
  const std::vector<Keypoint> alone{KeypointAt({200, 200}, kTable), KeypointAt({400, 300}, kTable)};
  EXPECT_EQ(Corrected(alone, kDelay_s).keypoints[0].depth_m, 0.0F);
  EXPECT_EQ(Corrected(alone, 0.001).keypoints[0].depth_m, alone[0].depth_m);
}

TEST(DepthDelay, WhatHasNoDepthGetsNone) {
  std::vector<Keypoint> keypoints = LatticeOn(kTable);
  keypoints[7].depth_m = 0.0F;
  EXPECT_EQ(Corrected(keypoints, kDelay_s).keypoints[7].depth_m, 0.0F);
}

TEST(DepthDelay, TheRateIsThatOfTheSurfaceSeenALittleLater) {
  constexpr double kStep_s = 1e-5;
  const Eigen::Vector3d ray = Camera().Ray({150.0, 330.0});
  const double difference = (SeenLater(kTable, kStep_s) - SeenLater(kTable, -kStep_s)).dot(ray) / (2.0 * kStep_s);
  EXPECT_NEAR(InverseDepthRate(kTable, ray, kMotion), difference, 1e-4 * std::abs(difference));
  const Rigid3 image_from_later{ExpSO3(kDelay_s * kMotion.turn_rate), kDelay_s * kMotion.velocity};
  EXPECT_LT((SurfaceIn(image_from_later, kTable) - SeenLater(kTable, kDelay_s)).norm(), 1e-9);
}

}  // namespace
}  // namespace tessera
