// The start of a part after a loss, on the synthetic world.
#include "tracking/part_start.h"

#include <gtest/gtest.h>

#include "core/time_units.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

class PartStartTest : public testing::Test {
 protected:
  static constexpr double kInterval_s = 0.1;

  std::shared_ptr<const FrameView> Take(int64_t step) {
    FeatureFrame features = world_.Take(step).features;
    features.utime_us = step * 100'000;
    return ViewOf(features);
  }
  // Half a meter a step.
  static MotionModel Steady() {
    MotionModel motion;
    for (int i = 0; i < 30; ++i) {
      const Rigid3 step = SyntheticWorld::Pose(i).Inverse() * SyntheticWorld::Pose(i + 1);
      motion.Add(step, 1e-6 * Eigen::Matrix3d::Identity(), kInterval_s);
    }
    return motion;
  }
  std::optional<MonoStart> StartFrom(int64_t first_step) {
    for (int64_t step = first_step; step < first_step + 15; ++step) {
      if (auto start = start_.Add(Take(step), lost_at_us_, ground_)) return start;
    }
    return std::nullopt;
  }
  TrackedFrame LastAt(int64_t step) {
    TrackedFrame last(Take(step));
    last.world_from_camera = SyntheticWorld::Pose(static_cast<double>(step));
    lost_at_us_ = last.view->features().utime_us;
    return last;
  }

  SyntheticWorld world_{SensorType::kMono, 0.3};
  PartStart start_{{.two_view = {.min_points = 100, .min_parallax_rad = 0.005}}};
  GroundWatch ground_;
  std::optional<int64_t> lost_at_us_;
};

TEST_F(PartStartTest, TheFirstPartBeginsAtTheOriginInUnitsOfItsOwn) {
  const auto start = StartFrom(0);
  ASSERT_TRUE(start.has_value());
  EXPECT_THAT(start_.world_from_start(), IsNear(Rigid3{}, 1e-12));
}

TEST_F(PartStartTest, AfterALossTheCameraHasMovedOnAsItDid) {
  start_.BeginAfter(LastAt(3), Steady(), Sim3{});
  EXPECT_THAT(start_.world_from_start(), IsNear(SyntheticWorld::Pose(3.0), 1e-12));
  const auto start = StartFrom(10);
  ASSERT_TRUE(start.has_value());
  const double truth_m = 0.5 * start->interval_s() / kInterval_s;
  EXPECT_NEAR(start->second_from_first.translation.norm(), truth_m, 0.01 * truth_m);
  const double way_m = (start_.world_from_start().translation - SyntheticWorld::Pose(3.0).translation).norm();
  EXPECT_NEAR(way_m, 0.5 * SecondsBetween(*Take(3), *start->first) / kInterval_s, 0.05);
}

// The points are triangulated by that way.
TEST_F(PartStartTest, PointsHaveTheScaleOfTheWay) {
  start_.BeginAfter(LastAt(3), Steady(), Sim3{});
  const auto start = StartFrom(10);
  ASSERT_TRUE(start.has_value());
  int num_near = 0;
  for (const MonoStart::Point& point : start->points) {
    const Eigen::Vector2d pixel = start->first->calibration().Project(point.point.point_in_world);
    EXPECT_LT((pixel - start->first->pixel(point.keypoint_first)).norm(), 3.0);
    const Eigen::Vector3d in_second = start->second_from_first * point.point.point_in_world;
    num_near +=
        (start->second->calibration().Project(in_second) - start->second->pixel(point.keypoint_second)).norm() < 3.0
            ? 1
            : 0;
  }
  EXPECT_GT(num_near, static_cast<int>(start->points.size()) * 9 / 10);
}

TEST_F(PartStartTest, OfACameraThatDidNotMoveSteadilyNothingIsGuessed) {
  const TrackedFrame last = LastAt(3);
  start_.BeginAfter(last, MotionModel{}, Sim3{});
  ASSERT_TRUE(StartFrom(10).has_value());
  EXPECT_THAT(start_.world_from_start(), IsNear(last.world_from_camera, 1e-12));
}

}  // namespace
}  // namespace tessera
