// A quadrotor in a hall.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/errors.h"
#include "simulation/drive.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

constexpr double kStepS = 1.0 / 20.0;

double TurnRate(const Trajectory& trajectory, double time_s) {
  const Rigid3 step = trajectory.WorldFromCamera(time_s).Inverse() * trajectory.WorldFromCamera(time_s + kStepS);
  return 2.0 * step.rotation.vec().norm() / kStepS;
}

TEST(Flight, StandsTakesOffFliesAndLands) {
  for (const uint32_t seed : {1U, 2U, 3U, 4U}) {
    const FlightTrajectory trajectory(60.0, 1.0, seed, 0.0);
    double way_m = 0.0, fastest_turn = 0.0;
    for (double time_s = 0.0; time_s + kStepS < trajectory.duration_s(); time_s += kStepS) {
      const Eigen::Vector3d position = trajectory.WorldFromCamera(time_s).translation;
      const double step_m = (trajectory.WorldFromCamera(time_s + kStepS).translation - position).norm();
      EXPECT_LT(step_m, kStepS * 3.5) << time_s;
      EXPECT_TRUE(time_s > 1.95 || step_m < 1e-9) << time_s;
      EXPECT_LT(std::abs(position.x()), 4.7) << "the machines begin there, seed " << seed;
      EXPECT_LT(std::abs(position.z()), 3.5) << "the machines begin there, seed " << seed;
      way_m += step_m;
      fastest_turn = std::max(fastest_turn, TurnRate(trajectory, time_s));
    }
    EXPECT_GT(way_m, 60.0);
    EXPECT_LT(way_m, 130.0);
    EXPECT_GT(fastest_turn, 1.0);
    EXPECT_LT(fastest_turn, 4.0);
    for (const double time_s : {0.0, 60.0})
      EXPECT_NEAR(trajectory.WorldFromCamera(time_s).translation.y(), -0.15, 0.01);
    EXPECT_LT(trajectory.WorldFromCamera(30.0).translation.y(), -0.8);
  }
}

TEST(Flight, IsKnockedOverWhereItShould) {
  const FlightTrajectory smooth(60.0, 1.0, 1, 0.0), bumped(60.0, 1.0, 1, 0.3);
  for (const double time_s : {1.05, 20.05, 40.05}) {
    EXPECT_GT(TurnRate(bumped, time_s), 6.0) << time_s;
    EXPECT_LT(TurnRate(smooth, time_s), 4.0) << time_s;
    const Rigid3 off = smooth.WorldFromCamera(time_s + 1.0).Inverse() * bumped.WorldFromCamera(time_s + 1.0);
    EXPECT_LT(off.rotation.vec().norm(), 1e-9) << "it is back";
  }
  EXPECT_THROW(ParseSimulation("flight,bumps=2"), InputError);
}

// Most of the hall is dark, and both eyes see that: they expose for as long as it takes.
TEST(Flight, PicturesAreNeitherBlackNorWhite) {
  for (const char* name : {"flight,scale=0.25", "flight,scale=0.25,seed=2"}) {
    Simulation simulation(ParseSimulation(name), SensorType::kStereo);
    Rendering light;
    double darkest = 255.0, brightest = 0.0;
    for (int64_t frame = 60; frame < simulation.num_frames(); frame += 97) {
      simulation.RenderPerfect(FrameId{frame}, light);
      const auto mean = [](const auto& image) {
        const double sum = std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0);
        return sum / static_cast<double>(image.pixels.size());
      };
      darkest = std::min(darkest, mean(light.radiance) / 256.0);
      brightest = std::max(brightest, mean(light.radiance) / 256.0);
      const CameraFrame seen = simulation.Render(FrameId{frame});
      EXPECT_NEAR(mean(seen.left), 85.0, 25.0) << name << " " << frame;
      EXPECT_NEAR(mean(seen.right), 85.0, 25.0) << name << " " << frame;
    }
    EXPECT_LT(darkest, 35.0) << name;
    EXPECT_GT(brightest, 1.5 * darkest) << name;
  }
}

}  // namespace
}  // namespace tessera
