// A walk that takes a picture every half second.
#include <gtest/gtest.h>

#include <cmath>

#include "simulation/simulation.h"
#include "simulation/street_plan.h"

namespace tessera {
namespace {

TEST(PlanStroll, ComesBackToTheFirstTwoSidesOfTheBlock) {
  const StreetPlan plan = PlanStroll(4, 0.0);
  EXPECT_GT(LengthOf(plan.drive), 450.0);
  EXPECT_FALSE(plan.has_traffic);
  size_t num_again = 0;
  const Polyline posts = Resample(plan.drive, 1.0);
  for (size_t i = posts.size() - 160; i + 20 < posts.size(); ++i) {
    for (size_t k = 0; k < 200; ++k) {
      if ((posts[i] - posts[k]).norm() < 1.0) {
        ++num_again;
        break;
      }
    }
  }
  EXPECT_GT(num_again, 120U);
  EXPECT_NEAR(LengthOf(PlanStroll(4, 100.0).drive), 100.0, 1.0);
}

TEST(Walk, StepsAreAboutAMeterAndSomeTurnsAreSharp) {
  for (const char* name : {"walk", "walk,seed=2", "walk,seed=3"}) {
    Simulation simulation(ParseSimulation(name), SensorType::kMono);
    EXPECT_NEAR(static_cast<double>(simulation.num_frames()), 500.0, 60.0) << name;
    EXPECT_EQ(simulation.UtimeOf(FrameId{2}), 1000000);
    int num_sharp = 0;
    double sum_m = 0.0, largest_roll = 0.0;
    const int64_t num = simulation.num_frames() - 1;
    for (int64_t frame = 0; frame < num; ++frame) {
      const Rigid3 pose = simulation.WorldFromCamera(FrameId{frame});
      const Rigid3 step = pose.Inverse() * simulation.WorldFromCamera(FrameId{frame + 1});
      EXPECT_GT(step.translation.norm(), 0.65) << name << " " << frame;
      EXPECT_LT(step.translation.norm(), 1.5) << name << " " << frame;
      const double turn = 2.0 * step.rotation.vec().norm();
      EXPECT_LT(turn, 0.9) << name << " " << frame;
      num_sharp += turn > 0.26 ? 1 : 0;
      sum_m += step.translation.norm();
      largest_roll = std::max(largest_roll, std::abs((pose.rotation * Eigen::Vector3d::UnitX()).y()));
    }
    EXPECT_GE(num_sharp, 12) << name;
    EXPECT_NEAR(sum_m / static_cast<double>(num), 1.05, 0.1) << name;
    EXPECT_GT(largest_roll, 0.02) << name;
    EXPECT_LT(largest_roll, 0.12) << name;
  }
}

}  // namespace
}  // namespace tessera
