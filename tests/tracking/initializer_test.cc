// The start of mono on the synthetic world: from which frames it starts, and how well.
#include "tracking/initializer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

const InitializerOptions kOptions{.two_view = {.min_points = 100, .min_parallax_rad = 0.005}};

// The first start, of frames at 0, 1, ...; nullopt if there is none by `num_frames`.
std::optional<MonoStart> StartWithin(int64_t num_frames, const std::function<Rigid3(int64_t)>& pose) {
  SyntheticWorld world(SensorType::kMono, 0.3);
  MonoInitializer initializer(kOptions);
  for (int64_t step = 0; step < num_frames; ++step) {
    if (auto start = initializer.Add(ViewOf(world.Take(step, pose(step)).features))) return start;
  }
  return std::nullopt;
}

Rigid3 Drive(int64_t step) { return SyntheticWorld::Pose(0.5 * static_cast<double>(step)); }

TEST(MonoInitializer, FindsTheMotionUpToScale) {
  const auto start = StartWithin(15, Drive);
  ASSERT_TRUE(start.has_value());
  const int64_t last = start->second->features().frame.value;
  EXPECT_EQ(start->first->features().frame.value, 0);
  EXPECT_GE(last, 1);
  const Rigid3 truth = Drive(last).Inverse() * Drive(0);
  const Rigid3 direction{start->second_from_first.rotation, start->second_from_first.translation.normalized()};
  EXPECT_THAT(direction, IsNear(Rigid3{truth.rotation, truth.translation.normalized()}, 0.05));
}

TEST(MonoInitializer, TheMedianDepthIsTheUnit) {
  const auto start = StartWithin(15, Drive);
  ASSERT_TRUE(start.has_value());
  ASSERT_GE(start->points.size(), 100U);
  std::vector<double> depths;
  for (const MonoStart::Point& point : start->points) depths.push_back(point.point.point_in_world.z());
  std::sort(depths.begin(), depths.end());
  EXPECT_NEAR(depths[depths.size() / 2], 1.0, 1e-12);
  EXPECT_GT(depths.front(), 0.0);
}

TEST(MonoInitializer, DoesNotStartFromACameraThatTurnsOnTheSpot) {
  const auto turn = [](int64_t step) {
    return Rigid3{ExpSO3({0.0, 0.01 * static_cast<double>(step), 0.0}), Eigen::Vector3d::Zero()};
  };
  EXPECT_FALSE(StartWithin(15, turn).has_value());
}

TEST(MonoInitializer, DoesNotStartFromACameraThatStands) {
  EXPECT_FALSE(StartWithin(10, [](int64_t) { return Rigid3(); }).has_value());
}

TEST(MonoInitializer, TakesANewReferenceWhereTheOldOneIsLostFromSight) {
  const auto jump = [](int64_t step) {
    return step == 0 ? Rigid3{ExpSO3({0.0, 1.5, 0.0}), Eigen::Vector3d::Zero()} : Drive(step);
  };
  const auto start = StartWithin(20, jump);
  ASSERT_TRUE(start.has_value());
  EXPECT_GE(start->first->features().frame.value, 1);
}

TEST(InitializerOptions, AreChecked) {
  EXPECT_THAT(InitializerOptions().Check(), IsSuccess());
  EXPECT_THAT((InitializerOptions{.min_matches = 7}).Check(), IsFailure(HasSubstr("at least 8")));
  EXPECT_THAT((InitializerOptions{.two_view = {.ransac_iterations = 0}}).Check(), IsFailure(testing::_));
}

}  // namespace
}  // namespace tessera
