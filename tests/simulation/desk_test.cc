// A hand-held camera with a rolling shutter that looks at a desk.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulation/drive.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

// Between two frames: m/s, rad/s.
struct Motion {
  double speed_mps, turn_radps;
};
Motion MotionBetween(const Rigid3& world_from_first, const Rigid3& world_from_second) {
  const Rigid3 step = world_from_first.Inverse() * world_from_second;
  return {30.0 * step.translation.norm(), 30.0 * 2.0 * step.rotation.vec().norm()};
}
Motion MotionAt(const Simulation& simulation, int64_t frame) {
  return MotionBetween(simulation.WorldFromCamera(FrameId{frame}), simulation.WorldFromCamera(FrameId{frame + 1}));
}

TEST(Desk, TheHandIsSlowAndTurnsFastAtMoments) {
  for (const char* name : {"desk", "desk,seed=2", "desk,seed=3"}) {
    const Simulation simulation(ParseSimulation(name), SensorType::kRgbd);
    EXPECT_EQ(simulation.num_frames(), 600) << "20 s at 30 Hz";
    std::vector<double> turns;
    for (int64_t frame = 0; frame + 1 < simulation.num_frames(); ++frame) {
      const Motion motion = MotionAt(simulation, frame);
      EXPECT_LT(motion.speed_mps, 1.0) << name << " " << frame;
      turns.push_back(motion.turn_radps);
    }
    std::sort(turns.begin(), turns.end());
    EXPECT_LT(turns[turns.size() / 2], 0.8) << name;
    EXPECT_GT(turns.back(), 2.0) << name;
    EXPECT_LT(turns.back(), 3.6) << name;
  }
}

TEST(Desk, NoLookAsideIsCutOff) {
  for (uint32_t seed = 1; seed <= 50; ++seed) {
    const DeskTrajectory trajectory(20.0, 1.0, seed);
    for (int frame = 0; frame < 600; ++frame) {
      const Motion motion =
          MotionBetween(trajectory.WorldFromCamera(frame / 30.0), trajectory.WorldFromCamera((frame + 1) / 30.0));
      ASSERT_LT(motion.turn_radps, 4.0) << "seed " << seed << ", frame " << frame;
    }
  }
}

TEST(Desk, LooksAtTheDeskAgainAndAgain) {
  const Simulation simulation(ParseSimulation("desk"), SensorType::kRgbd);
  const CameraCalibration& camera = simulation.calibration();
  int num_seen = 0, num_entries = 0;
  bool was_seen = false;
  for (int64_t frame = 0; frame < simulation.num_frames(); ++frame) {
    const Eigen::Vector3d screen =
        simulation.WorldFromCamera(FrameId{frame}).Inverse() * Eigen::Vector3d(-0.1, -0.95, 0.26);
    const Eigen::Vector2d p = camera.Project(screen);
    const bool is_seen = screen.z() > 0.0 && p.x() > 0.0 && p.y() > 0.0 && p.x() < 640.0 && p.y() < 480.0;
    num_seen += is_seen ? 1 : 0;
    num_entries += is_seen && !was_seen ? 1 : 0;
    was_seen = is_seen;
  }
  EXPECT_GT(num_seen, 200);
  EXPECT_LT(num_seen, 550);
  EXPECT_GE(num_entries, 4);
}

TEST(RollingShutter, TheTruthIsThePoseOfTheMiddleRow) {
  const Simulation simulation(ParseSimulation("desk"), SensorType::kMono);
  const FrameId frame{40};
  const double middle = 0.5 * (simulation.calibration().height_px - 1);
  EXPECT_EQ(simulation.WorldFromCameraAtRow(frame, middle).translation, simulation.WorldFromCamera(frame).translation);
  // From the first row to the last 25 ms pass, of 33 between two frames.
  const Rigid3 first = simulation.WorldFromCameraAtRow(frame, 0.0);
  const Rigid3 read = first.Inverse() * simulation.WorldFromCameraAtRow(frame, 479.0);
  const Rigid3 step = first.Inverse() * simulation.WorldFromCameraAtRow(FrameId{41}, 0.0);
  EXPECT_GT(step.translation.norm(), read.translation.norm());
  EXPECT_NEAR(read.translation.norm() / step.translation.norm(), 0.75, 0.15);
  const Simulation global(ParseSimulation("desk,readout=0"), SensorType::kMono);
  EXPECT_EQ(global.WorldFromCameraAtRow(frame, 0.0).translation, global.WorldFromCamera(frame).translation);
}

TEST(RollingShutter, ARowIsThatOfACameraAtItsPose) {
  Simulation rolling(ParseSimulation("desk"), SensorType::kMono);
  Rendering picture;
  rolling.RenderPerfect(FrameId{43}, picture);
  const World world = BuildDesk(1);
  Renderer renderer(std::make_shared<const World>(world));
  for (const int y : {0, 101, 239, 478}) {
    // Rows are drawn in pairs from the pose between them.
    const double row = 2 * (y / 2) + 0.5;
    Rendering still;
    renderer.Render(rolling.calibration(), rolling.WorldFromCameraAtRow(FrameId{43}, row), 0.0, still);
    for (int x = 0; x < 640; ++x) {
      ASSERT_EQ(picture.radiance.row(y)[x], still.radiance.row(y)[x]) << x << " " << y;
      ASSERT_EQ(picture.inverse_depth.row(y)[x], still.inverse_depth.row(y)[x]) << x << " " << y;
    }
  }
}

TEST(DepthDelay, DepthIsThatOfALaterMomentAndTheImageIsNot) {
  Simulation simulation(ParseSimulation("desk,readout=0,noise=0"), SensorType::kRgbd);
  Simulation late(ParseSimulation("desk,readout=0,noise=0,depth_delay=100"), SensorType::kRgbd);  // three frames
  const CameraFrame then = simulation.Render(FrameId{40}), later = simulation.Render(FrameId{43});
  const CameraFrame delayed = late.Render(FrameId{40});
  EXPECT_EQ(delayed.left, then.left);
  const auto share_equal = [&](const DepthImage& depth) {
    int num_equal = 0, num_measured = 0;
    for (size_t i = 0; i < depth.pixels.size(); ++i) {
      if (depth.pixels[i] == 0 || delayed.depth.pixels[i] == 0) continue;
      ++num_measured;
      if (std::abs(depth.pixels[i] - delayed.depth.pixels[i]) <= 30) ++num_equal;
    }
    EXPECT_GT(num_measured, 100'000);
    return static_cast<double>(num_equal) / num_measured;
  };
  EXPECT_GT(share_equal(later.depth), 0.95);
  EXPECT_LT(share_equal(then.depth), 0.5);
}

TEST(RightDelay, TheRightImageIsThatOfALaterMoment) {
  Simulation simulation(ParseSimulation("desk,readout=0,noise=0,scale=0.5"), SensorType::kStereo);
  Simulation late(ParseSimulation("desk,readout=0,noise=0,scale=0.5,right_delay=100"), SensorType::kStereo);
  const CameraFrame delayed = late.Render(FrameId{40});
  EXPECT_EQ(delayed.left, simulation.Render(FrameId{40}).left);
  EXPECT_EQ(delayed.right, simulation.Render(FrameId{43}).right);  // three frames
}

TEST(Desk, MostPixelsHaveADepthThatIsThatOfTheDrawing) {
  Simulation simulation(ParseSimulation("desk"), SensorType::kRgbd);
  const CameraFrame frame = simulation.Render(FrameId{150});
  Rendering drawn;
  simulation.RenderPerfect(FrameId{150}, drawn);
  int num_measured = 0, num_wrong = 0;
  for (size_t i = 0; i < frame.depth.pixels.size(); ++i) {
    if (frame.depth.pixels[i] == 0) continue;
    ++num_measured;
    const double z = 0.001 * frame.depth.pixels[i];
    EXPECT_TRUE(z >= 0.49 && z <= 4.51);
    num_wrong += std::abs(z * static_cast<double>(drawn.inverse_depth.pixels[i]) - 1.0) > 0.03 ? 1 : 0;
  }
  const auto num = static_cast<int>(frame.depth.pixels.size());
  EXPECT_GT(num_measured, num / 2);
  EXPECT_LT(num_measured, num * 97 / 100) << "there are holes";
  EXPECT_GT(num_wrong, 0) << "edges fray";
  EXPECT_LT(num_wrong, num_measured / 50);
}

}  // namespace
}  // namespace tessera
