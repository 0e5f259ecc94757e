#include "datasets/aligned_source.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/errors.h"
#include "datasets/changed_source.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

SourceOptions OptionsOf(const std::string& source, SensorType sensor = SensorType::kStereo) {
  SourceOptions options;
  options.source = source;
  options.sensor = sensor;
  return options;
}

double MeanDifference(const GrayImage& a, const GrayImage& b) {
  constexpr int kMargin = 20;
  double sum = 0.0;
  for (int y = kMargin; y < a.height - kMargin; ++y) {
    for (int x = kMargin; x < a.width - kMargin; ++x) sum += std::abs(a.row(y)[x] - b.row(y)[x]);
  }
  return sum / ((a.width - 2 * kMargin) * (a.height - 2 * kMargin));
}

bool TellsOfRows(const FrameSource& source) {
  for (const std::string& note : source.notes()) {
    if (note.find("the rows of the two cameras differ") != std::string::npos) return true;
  }
  return false;
}

TEST(AlignedSource, PutsTheImagesOfAPitchedCameraStraight) {
  const auto straight = OpenSource(OptionsOf("sim:room,duration=1"));
  const auto aligned = OpenSource(OptionsOf("sim:room,duration=1,pitch=0.4,twist=0.2"));
  Simulation pitched(ParseSimulation("room,duration=1,pitch=0.4,twist=0.2"), SensorType::kStereo);
  EXPECT_TRUE(TellsOfRows(*aligned));
  EXPECT_NEAR(aligned->right_turn().pitch, 0.4 * M_PI / 180.0, 1e-4);
  EXPECT_NEAR(aligned->right_turn().twist, 0.2 * M_PI / 180.0, 2e-4);
  EXPECT_EQ(aligned->calibration(), straight->calibration());
  const CameraFrame wanted = *straight->Next(), frame = *aligned->Next();
  EXPECT_EQ(frame.left, wanted.left);
  EXPECT_LT(MeanDifference(frame.right, wanted.right),
            0.5 * MeanDifference(pitched.Render(FrameId{0}).right, wanted.right));
}

TEST(AlignedSource, LeavesPairsThatAreRight) {
  const auto source = OpenSource(OptionsOf("sim:room,duration=1"));
  Simulation simulation(ParseSimulation("room,duration=1"), SensorType::kStereo);
  EXPECT_FALSE(TellsOfRows(*source));
  EXPECT_EQ(source->right_turn().pitch, 0.0);
  EXPECT_EQ(source->Next()->right, simulation.Render(FrameId{0}).right);
}

TEST(AlignedSource, TurnsImagesAlikeWhereverItBegins) {
  const auto all = OpenSource(OptionsOf("sim:room,duration=1,pitch=-0.3"));
  SourceOptions late = OptionsOf("sim:room,duration=1,pitch=-0.3");
  late.first_frame = 27;
  const auto rest = OpenSource(late);
  all->SkipTo(FrameId{27});
  EXPECT_EQ(all->Next(), rest->Next());
}

TEST(AlignedSource, AsksNothingOfOtherCameras) {
  const auto never = [](const SourceOptions&) -> std::unique_ptr<FrameSource> {
    ADD_FAILURE();
    return nullptr;
  };
  const SourceOptions options = OptionsOf("sim:room,duration=1", SensorType::kMono);
  EXPECT_NE(AlignRows(OpenSource(options), options, never), nullptr);
}

TEST(AlignedSource, LeavesPairsThatCannotBeMeasured) {
  const SourceOptions options = OptionsOf("sim:room,duration=1,pitch=0.4");
  Simulation simulation(ParseSimulation("room,duration=1,pitch=0.4"), SensorType::kStereo);
  class One : public ChangedSource {
   public:
    using ChangedSource::ChangedSource;
    void Change(CameraFrame& frame) const override { frame.age_us = 7; }
  };
  const auto damaged = [](const SourceOptions&) -> std::unique_ptr<FrameSource> { throw InputError("damaged"); };
  auto source = AlignRows(std::make_unique<One>(OpenSource(OptionsOf("sim:room,duration=1")), "one"), options, damaged);
  EXPECT_EQ(source->Next()->age_us, 7);
  EXPECT_EQ(source->notes(), std::vector<std::string>{"one"});
  // A single pair tells nothing.
  const auto short_source = [&](const SourceOptions& all) {
    SourceOptions first = all;
    first.last_frame = 1;
    return OpenSource(first);
  };
  EXPECT_FALSE(TellsOfRows(
      *AlignRows(std::make_unique<One>(OpenSource(OptionsOf("sim:room,duration=1")), "one"), options, short_source)));
}

}  // namespace
}  // namespace tessera
