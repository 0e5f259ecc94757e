// A drive on a motorway among others.
#include "simulation/highway.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "simulation/simulation.h"

namespace tessera {
namespace {

CarTrajectory Drive(const HighwayPlan& plan) {
  return CarTrajectory(plan.drive, 1.0, 1, {.cruise_mps = 28.0, .side_acceleration_mps2 = 3.5, .drives_on = true});
}

TEST(PlanHighway, DrivesInItsLanesAndChangesBetweenThem) {
  for (const uint32_t seed : {1U, 2U, 3U}) {
    const HighwayPlan plan = PlanHighway(seed, 0.0);
    EXPECT_NEAR(LengthOf(plan.drive), 3000.0, 60.0);
    const StreetMap road({plan.middle});
    int num_left = 0, num_right = 0, num = 0;
    for (const Eigen::Vector2d& p : Resample(plan.drive, 5.0)) {
      const double lateral_m = road.PositionOf(p).lateral_m;
      EXPECT_GT(lateral_m, kLeftLaneM - 0.05);
      EXPECT_LT(lateral_m, kRightLaneM + 0.05);
      ++num;
      num_left += std::abs(lateral_m - kLeftLaneM) < 0.1 ? 1 : 0;
      num_right += std::abs(lateral_m - kRightLaneM) < 0.1 ? 1 : 0;
    }
    EXPECT_GT(num_left, num / 4);
    EXPECT_GT(num_right, num / 4);
    EXPECT_GT(num_left + num_right, num / 2);
  }
  EXPECT_NEAR(LengthOf(PlanHighway(1, 400.0).drive), 400.0, 1.0);
}

TEST(PlanHighway, BendsAreThoseOfAMotorway) {
  const Polyline posts = Resample(PlanHighway(4, 0.0).middle, 20.0);
  for (size_t i = 1; i + 1 < posts.size(); ++i) {
    const double curvature = (posts[i - 1] - 2.0 * posts[i] + posts[i + 1]).norm() / (20.0 * 20.0);
    EXPECT_LT(curvature, 1.0 / 600.0);
  }
}

TEST(BuildHighway, NothingStandsOnTheLanes) {
  const HighwayPlan plan = PlanHighway(2, 0.0);
  const World world = BuildHighway(plan, 2);
  constexpr double kClearM = 4.5;  // above the road
  for (const Surface& surface : world.surfaces) {
    for (const Eigen::Vector3d& corner : surface.Corners()) {
      const double height_m = -corner.y();
      if (height_m < 0.01 || height_m > kClearM) continue;
      const double side = world.streets->DistanceToStreet({corner.x(), corner.z()});
      EXPECT_FALSE(side > kInnerLineM && side < kHardShoulderM) << side;
    }
  }
}

TEST(HighwayTraffic, LorriesAreFollowedAndPassed) {
  const HighwayPlan plan = PlanHighway(3, 0.0);
  const auto drive = std::make_shared<const CarTrajectory>(Drive(plan));
  World world = BuildHighway(plan, 3);
  AddHighwayTraffic(plan, drive, 3, world);
  // How far ahead of the camera a vehicle of the same direction is, at each second.
  int num_followed = 0, num_passed = 0;
  for (const Mover& car : world.movers) {
    double at_first = 0.0, at_last = 0.0;
    int num_near = 0;
    for (double time = 0.0; time + 1.0 < drive->duration_s(); time += 1.0) {
      const double position = car.position_m(time) / kMoverStepM;
      if (position < 1.0 || position + 2.0 > static_cast<double>(car.way.size())) continue;
      const auto i = static_cast<size_t>(position);
      const Eigen::Vector2d ahead = drive->DirectionAt(time), along = (car.way[i + 1] - car.way[i]).normalized();
      if (along.dot(ahead) < 0.0) break;  // it comes toward the camera
      const double distance_m = (car.way[i] - drive->PositionAt(time)).dot(ahead);
      num_near += distance_m > 15.0 && distance_m < 40.0 ? 1 : 0;
      if (at_first == 0.0) at_first = distance_m;
      at_last = distance_m;
    }
    num_followed += num_near >= 8 ? 1 : 0;
    num_passed += at_first > 0.0 && at_last < 0.0 ? 1 : 0;
  }
  EXPECT_GE(num_followed, 2);
  EXPECT_GE(num_passed, 4);
}

TEST(Highway, GoesAtItsSpeed) {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kHighway;
  options.length_m = 500.0;
  options.scale = 0.25;
  const Simulation simulation(options, SensorType::kMono);
  ASSERT_GT(simulation.num_frames(), 100);
  const Rigid3 before = simulation.WorldFromCamera(FrameId{50}), after = simulation.WorldFromCamera(FrameId{51});
  EXPECT_NEAR((after.translation - before.translation).norm(), 2.8, 0.1);
}

}  // namespace
}  // namespace tessera
