#include "occupancy/scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "occupancy/occupancy_options.h"
#include "support/depth_room.h"
#include "support/map_changes.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

TEST(Scan, ADepthImageGivesItsPixelsThatHaveDepthAsPoints) {
  CameraFrame frame;
  frame.left = GrayImage(80, 60, 7);
  frame.depth = DepthImage(80, 60);
  frame.depth.row(30)[39] = 2000;
  frame.left.row(30)[39] = 201;
  const OccupancyOptions options{.resolution = 0.01, .max_range = 4.0};
  const std::vector<ScanPoint> points = PointsOf(ScanFromImages(frame, {}, kDepthCamera, options, 0));
  ASSERT_EQ(points.size(), 1U);
  EXPECT_TRUE(points[0].in_camera.isApprox(2.0 * kDepthCamera.Ray({39, 30})));
  EXPECT_EQ(points[0].color, (Rgb{201, 201, 201}));
}

TEST(Scan, PointsHaveTheColorsOfTheImageWhereItHasAny) {
  const OccupancyOptions options{.resolution = 0.25, .max_range = 4.0};
  ColorImage color(80, 60, {.red = 9, .green = 8, .blue = 7});
  color.row(0)[3] = {.red = 1, .green = 2, .blue = 3};
  const Scan scan = ScanFromImages(DepthFrameOf({}), color, kDepthCamera, options, 0);
  EXPECT_TRUE(scan.intensity.empty());
  const std::vector<ScanPoint> points = PointsOf(scan);
  ASSERT_GT(points.size(), 2U);
  EXPECT_EQ(points[0].color, (Rgb{9, 8, 7}));
  EXPECT_EQ(points[1].color, (Rgb{1, 2, 3})) << "the next pixel that is kept";
}

TEST(Scan, RaysAreNoFartherApartThanAVoxelAtTheMaximumRange) {
  const OccupancyOptions options{.resolution = 0.25, .max_range = 4.0};
  const Scan scan = ScanFromImages(DepthFrameOf({}), {}, kDepthCamera, options, 0);
  EXPECT_EQ(scan.stride_px, 3);
  EXPECT_LE(scan.stride_px * options.max_range / kDepthCamera.fx_px, options.resolution);
  EXPECT_EQ(scan.depth.width, 27);
  EXPECT_EQ(scan.depth.height, 20);
}

TEST(Scan, AStereoPairIsMatched) {
  constexpr int kDisparityPx = 10;
  const CameraCalibration camera{.sensor = SensorType::kStereo,
                                 .width_px = 160,
                                 .height_px = 120,
                                 .fx_px = 100.0,
                                 .fy_px = 100.0,
                                 .cx_px = 80.0,
                                 .cy_px = 60.0,
                                 .baseline_m = 0.2};
  CameraFrame frame;
  frame.sensor = SensorType::kStereo;
  frame.left = RectanglesImage(camera.width_px, camera.height_px, 3);
  frame.right = GrayImage(camera.width_px, camera.height_px);
  for (int y = 0; y < camera.height_px; ++y) {
    for (int x = 0; x + kDisparityPx < camera.width_px; ++x) {
      frame.right.row(y)[x] = frame.left.row(y)[x + kDisparityPx];
    }
  }
  const OccupancyOptions options = FitToSensor({}, camera);
  EXPECT_DOUBLE_EQ(options.max_range, 100.0 * 0.2 / 6.0);
  EXPECT_DOUBLE_EQ(options.resolution, options.max_range / 160.0);
  EXPECT_EQ(options.min_hits, 2);
  const std::vector<ScanPoint> points = PointsOf(ScanFromImages(frame, {}, camera, options, 32));
  ASSERT_GT(points.size(), 5000U);
  const double depth_m = camera.fx_px * camera.baseline_m / kDisparityPx;
  const auto num_right = std::count_if(points.begin(), points.end(), [&](const ScanPoint& point) {
    return std::abs(point.in_camera.z() - depth_m) < 0.02 * depth_m;
  });
  EXPECT_GT(static_cast<double>(num_right), 0.9 * static_cast<double>(points.size()));
  // Also of columns in which the widest disparity would begin outside of the right image.
  const auto num_at_the_left = std::count_if(points.begin(), points.end(), [&](const ScanPoint& point) {
    const double x_px = camera.fx_px * point.in_camera.x() / point.in_camera.z() + camera.cx_px;
    return x_px > kDisparityPx && x_px < 32.0;
  });
  EXPECT_GT(num_at_the_left, 1000);
}

TEST(Scan, StereoIsUncertainByTheSquareOfTheDistanceAndOtherSensorsAreNot) {
  CameraCalibration camera{.sensor = SensorType::kStereo, .fx_px = 400.0, .baseline_m = 0.1};
  EXPECT_DOUBLE_EQ(UncertaintyAt(2.0, camera), 0.5 * 2.0 * 2.0 / 40.0);
  EXPECT_DOUBLE_EQ(UncertaintyAt(4.0, camera), 4.0 * UncertaintyAt(2.0, camera));
  camera.sensor = SensorType::kRgbd;
  EXPECT_EQ(UncertaintyAt(2.0, camera), 0.0);
}

TEST(Scan, TheLandmarksThatAKeyframeObservesAreItsPoints) {
  Map map;
  std::mt19937 generator(5);
  for (int i = 0; i < 3; ++i) RandomChange(map, generator);
  const Keyframe& keyframe = *map.FindKeyframe({2});
  const Scan scan = ScanFromLandmarks(map, keyframe, {});
  size_t num_landmarks = 0;
  for (const LandmarkId id : keyframe.landmarks) num_landmarks += id.valid() ? 1 : 0;
  const std::vector<ScanPoint> points = PointsOf(scan);
  ASSERT_GT(num_landmarks, 0U);
  ASSERT_EQ(points.size(), num_landmarks);
  const auto first =
      std::find_if(keyframe.landmarks.begin(), keyframe.landmarks.end(), [](auto id) { return id.valid(); });
  EXPECT_TRUE((keyframe.world_from_camera * points[0].in_camera).isApprox(map.FindLandmark(*first)->position_in_world));
  std::vector<Rgb> colors(keyframe.landmarks.size());
  colors[static_cast<size_t>(first - keyframe.landmarks.begin())] = {.red = 5};
  EXPECT_EQ(PointsOf(ScanFromLandmarks(map, keyframe, colors))[0].color, Rgb{.red = 5});
}

TEST(OccupancyOptions, WhatIsGivenIsNotChangedByTheSensor) {
  const OccupancyOptions options = FitToSensor({.resolution = 0.5, .max_range = 9.0}, kDepthCamera);
  EXPECT_EQ(options.resolution, 0.5);
  EXPECT_EQ(options.max_range, 9.0);
}

}  // namespace
}  // namespace tessera
