// A drive that waits for others.
#include <gtest/gtest.h>

#include "simulation/drive.h"
#include "simulation/simulation.h"
#include "simulation/street_plan.h"

namespace tessera {
namespace {

constexpr double kLengthM = 400.0;  // with two of the stops

// The share of the image in which something is nearer by a tenth in one picture than in the other.
double ChangedShare(const Rendering& a, const Rendering& b) {
  size_t num = 0;
  for (size_t i = 0; i < a.inverse_depth.pixels.size(); ++i) {
    const float before = a.inverse_depth.pixels[i], behind = b.inverse_depth.pixels[i];
    num += std::abs(before - behind) > 0.1F * std::max(before, behind) ? 1 : 0;
  }
  return static_cast<double>(num) / static_cast<double>(a.inverse_depth.pixels.size());
}

TEST(PlanTraffic, StopsBeforeEachCrossing) {
  const StreetPlan plan = PlanTraffic(3, 0.0, 12.0);
  ASSERT_EQ(plan.stops.size(), 3U);
  for (const Stop& stop : plan.stops) {
    const double distance_m = StreetMap({stop.crossing}).DistanceToStreet(Shorten(plan.drive, stop.at_m).back());
    EXPECT_GT(distance_m, 10.0);
    EXPECT_LT(distance_m, 12.5);
  }
}

TEST(CarTrajectory, StandsWhereItWaits) {
  CarMotion motion;
  motion.waits = {{20.0, 5.0}, {60.0, 3.0}};
  const Polyline straight{{0.0, 0.0}, {0.0, 100.0}};
  const CarTrajectory waiting(straight, 1.0, 3, motion);
  ASSERT_EQ(waiting.wait_times_s().size(), 2U);
  for (size_t i = 0; i < 2; ++i) {
    const double begin_s = waiting.wait_times_s()[i], end_s = begin_s + motion.waits[i].duration_s;
    const Rigid3 first = waiting.WorldFromCamera(begin_s), last = waiting.WorldFromCamera(end_s);
    EXPECT_NEAR(waiting.DistanceAt(begin_s), motion.waits[i].at_m, 0.25);
    EXPECT_NEAR((first.translation - last.translation).norm(), 0.0, 1e-9);
    EXPECT_NEAR(first.rotation.angularDistance(last.rotation), 0.0, 1e-9);
    EXPECT_GT(waiting.DistanceAt(end_s + 1.0), motion.waits[i].at_m + 0.3);
    EXPECT_LT(waiting.DistanceAt(begin_s - 1.0), motion.waits[i].at_m - 0.3);
  }
  EXPECT_NEAR(waiting.DistanceAt(waiting.duration_s()), 100.0, 0.3);
}

TEST(Traffic, LargeVehiclesCrossWhileTheCameraStands) {
  for (const uint32_t seed : {1U, 2U}) {
    SimulationOptions options;
    options.scene = SimulationOptions::Scene::kTraffic;
    options.seed = seed;
    options.length_m = kLengthM;
    options.scale = 0.25;
    Simulation simulation(options, SensorType::kMono);
    double largest = 0.0;
    int num_standing = 0;
    Rendering first, later;
    for (int64_t frame = 5; frame + 5 < simulation.num_frames(); frame += 5) {
      const Rigid3 here = simulation.WorldFromCamera(FrameId{frame});
      const Rigid3 next = simulation.WorldFromCamera(FrameId{frame + 5});
      if ((next.translation - here.translation).norm() > 1e-9) continue;
      simulation.RenderPerfect(FrameId{frame}, first);
      simulation.RenderPerfect(FrameId{frame + 5}, later);
      largest = std::max(largest, ChangedShare(first, later));
      ++num_standing;
    }
    EXPECT_GE(num_standing, 30) << "two waits of 9 s";
    EXPECT_GT(largest, 0.12) << "seed " << seed;
  }
}

}  // namespace
}  // namespace tessera
