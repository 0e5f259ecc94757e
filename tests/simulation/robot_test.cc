// A wheeled robot that turns where it stands.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulation/drive.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

constexpr double kStepS = 1.0 / 30.0;

TEST(Robot, DrivesOrTurnsAndEndsWhereItBegan) {
  for (const uint32_t seed : {1U, 2U}) {
    const RobotTrajectory trajectory({6.4, 2.7, 5.2}, 1.0, seed);
    double way_m = 0.0, turn_rad = 0.0;
    for (double time_s = 0.0; time_s + kStepS < trajectory.duration_s(); time_s += kStepS) {
      const Rigid3 step = trajectory.WorldFromCamera(time_s).Inverse() * trajectory.WorldFromCamera(time_s + kStepS);
      const double speed = step.translation.norm() / kStepS, turn = 2.0 * step.rotation.vec().norm() / kStepS;
      EXPECT_LT(speed, 0.6) << time_s;
      EXPECT_LT(turn, 2.5) << time_s;
      EXPECT_TRUE(turn < 0.3 || speed < 0.25) << "only the camera's arm moves it at " << time_s;
      way_m += speed * kStepS;
      turn_rad += turn * kStepS;
    }
    EXPECT_NEAR(way_m, 2.0 * 2.0 * (3.0 + 2.3), 4.0);
    EXPECT_NEAR(turn_rad, 2.0 * (2.0 * M_PI_2 + 2.0 * 3.0 * M_PI_2), 1.5);
    const Rigid3 round =
        trajectory.WorldFromCamera(0.0).Inverse() * trajectory.WorldFromCamera(trajectory.duration_s());
    EXPECT_LT(round.translation.norm(), 0.02);
    EXPECT_LT(round.rotation.vec().norm(), 0.01);
  }
}

TEST(Robot, KeepsAwayFromTheFurniture) {
  for (const char* name : {"robot", "robot,seed=2", "robot,seed=3"}) {
    Simulation simulation(ParseSimulation(name), SensorType::kRgbd);
    Rendering picture;
    for (int64_t frame = 0; frame < simulation.num_frames(); frame += 97) {
      simulation.RenderPerfect(FrameId{frame}, picture);
      const auto& inverse_depths = picture.inverse_depth.pixels;
      const auto [farthest, nearest] = std::minmax_element(inverse_depths.begin(), inverse_depths.end());
      EXPECT_LT(*nearest, 1.0 / 0.25) << name << " " << frame;
      EXPECT_GT(*farthest, 1.0 / 9.0) << name << " " << frame;
    }
  }
}

}  // namespace
}  // namespace tessera
