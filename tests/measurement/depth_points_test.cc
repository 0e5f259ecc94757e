#include "measurement/depth_points.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "measurement/keypoint_measurement.h"
#include "support/matchers.h"

namespace tessera {
namespace {

using testing::HasSubstr;

// A stereo image of 200 keypoints, in no order of depth (0.6 to 25 m at a baseline of 0.12 m); every fifth has none.
FeatureFrame MakeFeatures() {
  FeatureFrame features;
  features.calibration = {.sensor = SensorType::kStereo,
                          .width_px = 640,
                          .height_px = 480,
                          .fx_px = 500,
                          .fy_px = 500,
                          .cx_px = 320,
                          .cy_px = 240,
                          .baseline_m = 0.12};
  for (int i = 0; i < 200; ++i) {
    Keypoint& keypoint = features.keypoints.emplace_back();
    keypoint.x_px = 200.0F + static_cast<float>(i);
    keypoint.y_px = 100.0F;
    const float disparity_px = 2.4F + static_cast<float>((i * 37) % 97);
    if (i % 5 != 0) keypoint.right_x_px = keypoint.x_px - disparity_px;
  }
  return features;
}

const auto kNone = [](int32_t) { return false; };

TEST(NewDepthPoints, AreTheNearestFirst) {
  const FeatureFrame features = MakeFeatures();
  const auto points = NewDepthPoints(features, kNone, {.max_baselines = 1e6});
  ASSERT_EQ(points.size(), 160U);
  const auto depth_of = [](const DepthPoint& point) { return point.point_in_camera.z(); };
  EXPECT_TRUE(std::ranges::is_sorted(points, {}, depth_of));
  for (const DepthPoint& point : points) EXPECT_EQ(point.point_in_camera, PointFromDepth(features, point.keypoint));
}

TEST(NewDepthPoints, FarOnesCountWhileFewAreKnown) {
  const FeatureFrame features = MakeFeatures();
  EXPECT_TRUE(NewDepthPoints(features, kNone, {.max_baselines = 0.0, .min_points = 0}).empty());
  EXPECT_EQ(NewDepthPoints(features, kNone, {.max_baselines = 0.0, .min_points = 30}).size(), 30U);
  const auto first_ten = [](int32_t keypoint) { return keypoint < 10; };
  const auto points = NewDepthPoints(features, first_ten, {.max_baselines = 0.0, .min_points = 30});
  EXPECT_EQ(points.size(), 20U);
  EXPECT_TRUE(std::ranges::all_of(points, [](const DepthPoint& point) { return point.keypoint >= 10; }));
}

TEST(DepthPointOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(DepthPointOptions{}.Check(), IsSuccess());
  EXPECT_THAT(DepthPointOptions{.max_baselines = -1.0}.Check(), IsFailure(HasSubstr("max_baselines")));
  EXPECT_THAT(DepthPointOptions{.min_points = -1}.Check(), IsFailure(HasSubstr("min_points")));
}

}  // namespace
}  // namespace tessera
