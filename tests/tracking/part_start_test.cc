// The start of a part of a mono map, in the synthetic world.
#include "tracking/part_start.h"

#include <gtest/gtest.h>

#include "support/synthetic_world.h"

namespace tessera {
namespace {

class PartStartTest : public testing::Test {
 protected:
  std::shared_ptr<const FrameView> Take(int64_t step) {
    FeatureFrame features = world_.Take(step).features;
    features.utime_us = step * 100'000;
    return ViewOf(features);
  }
  std::optional<MonoStart> StartFrom(int64_t first_step, const KnownSpeed& speed) {
    for (int64_t step = first_step; step < first_step + 15; ++step) {
      if (auto start = start_.Add(Take(step), speed, KeyframeId{3}, ground_)) return start;
    }
    return std::nullopt;
  }

  SyntheticWorld world_{SensorType::kMono, 0.3};
  PartStart start_{{.two_view = {.min_points = 100, .min_parallax_rad = 0.005}}};
  GroundWatch ground_;
};

TEST_F(PartStartTest, TheFirstPartHasUnitsOfItsOwn) {
  const auto start = StartFrom(0, {});
  ASSERT_TRUE(start.has_value());
  EXPECT_GT(start->points.size(), 100U);
}

// Half a meter in a tenth of a second; the points are as far away as that has it.
TEST_F(PartStartTest, AfterALossTheCameraGoesAsFastAsItDid) {
  const auto start = StartFrom(10, {.before_loss = 5.0, .tracked_utime_us = 300'000});
  ASSERT_TRUE(start.has_value());
  EXPECT_NEAR(start->second_from_first.translation.norm(), 5.0 * start->interval_s(), 1e-9);
  size_t num_near = 0;
  for (const MonoStart::Point& point : start->points) {
    const Eigen::Vector3d in_second = start->second_from_first * point.point.point_in_world;
    const Eigen::Vector2d pixel = start->second->calibration().Project(in_second);
    num_near += (pixel - start->second->pixel(point.keypoint_second)).norm() < 3.0 ? 1U : 0U;
  }
  EXPECT_GT(num_near, start->points.size() * 9 / 10);
}

TEST_F(PartStartTest, BeginsAfreshAfterARestart) {
  StartFrom(0, {});
  (void)start_.Add(Take(20), {}, KeyframeId{3}, ground_);
  start_.Restart();
  const auto start = StartFrom(30, {});
  ASSERT_TRUE(start.has_value());
  EXPECT_GE(start->first->features().frame.value, 30);
}

}  // namespace
}  // namespace tessera
