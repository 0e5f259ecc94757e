// A simulated world as a source of frames.
#include "datasets/simulated_source.h"

#include <gtest/gtest.h>

#include "core/errors.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

constexpr const char* kSmallRoom = "room,scale=0.25";

TEST(SimulatedSource, YieldsTheFramesOfTheSimulationWithTheirTruth) {
  const auto source = OpenSimulation(kSmallRoom, {.sensor = SensorType::kRgbd, .first_frame = 5, .last_frame = 8});
  Simulation simulation(ParseSimulation(kSmallRoom), SensorType::kRgbd);
  EXPECT_EQ(source->num_frames(), 3);
  ASSERT_EQ(source->ground_truth().size(), 3U);
  EXPECT_FALSE(source->is_live());
  for (int64_t id = 5; id < 8; ++id) {
    const std::optional<CameraFrame> frame = source->Next();
    ASSERT_TRUE(frame.has_value());
    const CameraFrame expected = simulation.Render({id});
    EXPECT_EQ(frame->id, FrameId{id});
    EXPECT_EQ(frame->utime_us, simulation.UtimeOf({id}));
    EXPECT_EQ(frame->left.pixels, expected.left.pixels);
    EXPECT_EQ(frame->depth.pixels, expected.depth.pixels);
    const GroundTruthPose& truth = source->ground_truth()[static_cast<size_t>(id - 5)];
    EXPECT_EQ(truth.frame, FrameId{id});
    EXPECT_EQ(truth.world_from_camera.translation, simulation.WorldFromCamera({id}).translation);
  }
  EXPECT_FALSE(source->Next().has_value());
}

TEST(SimulatedSource, RefusesACalibrationFileAndUnknownWorlds) {
  EXPECT_THROW((void)OpenSimulation(kSmallRoom, {.calibration_path = "camera.yaml"}), InputError);
  EXPECT_THROW((void)OpenSimulation("castle", {}), InputError);
}

}  // namespace
}  // namespace tessera
