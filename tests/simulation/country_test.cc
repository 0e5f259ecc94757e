// A rural road: hills, open stretches in its bends, and a lap that closes.
#include "simulation/country.h"

#include <gtest/gtest.h>

#include <cmath>

#include "simulation/simulation.h"
#include "simulation/terrain.h"

namespace tessera {
namespace {

constexpr uint32_t kSeeds[] = {1, 2, 3, 4, 5};

double DistanceTo(const Polyline& line, const Eigen::Vector2d& point) {
  double nearest = 1e9;
  for (const Eigen::Vector2d& p : line) nearest = std::min(nearest, (p - point).norm());
  return nearest;
}

TEST(PlanCountry, TheLapClosesAndIsDrivenABitFurther) {
  for (const uint32_t seed : kSeeds) {
    const CountryPlan plan = PlanCountry(seed, 0.0);
    EXPECT_NEAR(LengthOf(plan.road), 4000.0, 1.0);
    EXPECT_EQ(plan.road.front(), plan.road.back());
    EXPECT_NEAR(LengthOf(plan.drive), 4150.0, 40.0) << "the right lane is not the middle line";
    const Polyline first(plan.drive.begin(), plan.drive.begin() + 1000);
    for (size_t i = plan.drive.size() - 500; i < plan.drive.size(); i += 50) {
      EXPECT_LT(DistanceTo(first, plan.drive[i]), 0.2) << seed;
    }
  }
  EXPECT_NEAR(LengthOf(PlanCountry(1, 300.0).drive), 300.0, 2.0);
}

TEST(PlanCountry, AThirdOfTheRoadIsOpenButNotWhereTheLapCloses) {
  for (const uint32_t seed : kSeeds) {
    double open_m = 0.0, end_m = 0.0;
    for (const Stretch& stretch : PlanCountry(seed, 0.0).stretches) {
      EXPECT_EQ(stretch.from_m, end_m) << "no gaps";
      end_m = stretch.to_m;
      if (stretch.kind != Stretch::Kind::kOpen) continue;
      open_m += stretch.to_m - stretch.from_m + 2.0 * kOpenM;
      EXPECT_GE(stretch.to_m - stretch.from_m, 20.0);
      EXPECT_LE(stretch.to_m - stretch.from_m, 130.0);
      EXPECT_TRUE(stretch.from_m >= 200.0 && stretch.to_m <= 3800.0) << seed;
    }
    EXPECT_DOUBLE_EQ(end_m, 4000.0);
    EXPECT_GT(open_m, 1000.0) << seed;
    EXPECT_LT(open_m, 1700.0) << seed;
  }
}

TEST(BuildCountry, NothingStandsNearAnOpenStretchNorOnTheRoad) {
  const CountryPlan plan = PlanCountry(2, 0.0);
  const Terrain terrain(plan.road, 2);
  const World world = BuildCountry(plan, terrain, 2);
  Polyline open;
  for (const Stretch& stretch : plan.stretches) {
    if (stretch.kind != Stretch::Kind::kOpen) continue;
    for (double along = stretch.from_m; along < stretch.to_m; along += 10.0) {
      open.push_back(plan.road[static_cast<size_t>(4.0 * along)]);
    }
  }
  int num_standing = 0;
  for (const Surface& surface : world.surfaces) {
    if (surface.part != SurfacePart::kWhole) continue;  // the ground
    ++num_standing;
    const Eigen::Vector3d middle = surface.Center();
    const double half_m = 0.5 * Eigen::Vector2d(surface.across.x(), surface.across.z()).norm();
    ASSERT_GT(DistanceTo(open, {middle.x(), middle.z()}), kOpenM - half_m - 6.0);
    const bool is_crown = surface.two_sided;
    ASSERT_GT(terrain.road().DistanceToStreet({middle.x(), middle.z()}), is_crown ? 5.0 : 4.4);
  }
  EXPECT_GT(num_standing, 1500);
}

TEST(Terrain, TheRoadClimbsAndIsLevelAcross) {
  for (const uint32_t seed : kSeeds) {
    const CountryPlan plan = PlanCountry(seed, 0.0);
    const Terrain terrain(plan.road, seed);
    double steepest = 0.0, low = 1e9, high = -1e9;
    for (size_t i = 40; i + 40 < plan.road.size(); i += 40) {
      const Eigen::Vector2d along = (plan.road[i + 4] - plan.road[i - 4]).normalized();
      const double height = terrain.HeightAt(plan.road[i]);
      low = std::min(low, height);
      high = std::max(high, height);
      steepest = std::max(steepest, std::abs(terrain.HeightAt(plan.road[i + 40]) - height) / 10.0);
      for (const double side : {-5.0, 5.0}) {
        EXPECT_NEAR(terrain.HeightAt(plan.road[i] + side * RightOf(along)), height, 0.05) << seed << " " << i;
      }
    }
    EXPECT_GT(high - low, 15.0) << seed;
    EXPECT_GT(steepest, 0.05) << seed;
    EXPECT_LT(steepest, 0.25) << seed;
  }
}

TEST(Country, IsDrivenAtTheSpeedOfACarThatStaysOnItsWheels) {
  const CountryPlan plan = PlanCountry(3, 0.0);
  const Terrain terrain(plan.road, 3);
  Simulation simulation(ParseSimulation("country,seed=3"), SensorType::kMono);
  EXPECT_GE(simulation.num_frames(), 2400);
  EXPECT_LE(simulation.num_frames(), 3000);
  for (int64_t frame = 100; frame + 101 < simulation.num_frames(); frame += 7) {
    const Rigid3 pose = simulation.WorldFromCamera(FrameId{frame});
    const Rigid3 step = pose.Inverse() * simulation.WorldFromCamera(FrameId{frame + 1});
    EXPECT_GT(step.translation.norm(), 0.8) << frame;
    EXPECT_LT(step.translation.norm(), 1.75) << frame;
    EXPECT_LT(2.0 * step.rotation.vec().norm(), 0.06) << frame;
    const Eigen::Vector3d& eye = pose.translation;
    EXPECT_NEAR(-eye.y() - terrain.HeightAt({eye.x(), eye.z()}), 1.65, 0.1) << frame;
  }
}

}  // namespace
}  // namespace tessera
