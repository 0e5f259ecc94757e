// Dispatcher, extractors and reassembler together in one process, with losses and deaths.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "features/extractor.h"
#include "features/selection.h"
#include "features/tiling.h"
#include "messages/tracking_types.h"
#include "stages/dispatcher/dispatcher_stage.h"
#include "stages/extractor/extractor_stage.h"
#include "stages/reassembler/reassembler_stage.h"
#include "support/memory_bus.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

constexpr int kNumFrames = 12;
const CameraCalibration kRig{.sensor = SensorType::kStereo,
                             .width_px = 320,
                             .height_px = 240,
                             .fx_px = 300,
                             .fy_px = 300,
                             .cx_px = 160,
                             .cy_px = 120,
                             .baseline_m = 0.1};

CameraFrame Frame(int64_t id) {
  CameraFrame frame;
  frame.id = {id};
  frame.utime_us = 100'000 * id;
  frame.depth_delay_us = 1'000 * id - 2'000;
  frame.sensor = SensorType::kStereo;
  frame.left = RectanglesImage(320, 240, static_cast<unsigned>(id));
  frame.right = frame.left;
  std::rotate(frame.right.pixels.begin(), frame.right.pixels.begin() + 8, frame.right.pixels.end());
  return frame;
}

std::vector<FeatureFrame> Expected() {
  std::vector<FeatureFrame> frames;
  Extractor extractor;
  for (int64_t id = 0; id < kNumFrames; ++id) {
    std::vector<TileFeatures> tiles;
    for (const TileJob& job : CutFrame(Frame(id), kRig, 0, {}, 4, FeatureOptions{})) {
      tiles.push_back(extractor.Extract(job));
    }
    frames.push_back(SelectFeatures(tiles).value().features);
  }
  return frames;
}

// Stands for the camera and the tracker, and collects what comes out.
class Ends {
 public:
  explicit Ends(MemoryBus& bus)
      : camera_(bus.AddContext("camera")),
        tracker_(bus.AddContext("tracker")),
        frames_(camera_.Advertise(kCamera)),
        calibration_(camera_.Advertise(kCalibration)),
        end_(camera_.Advertise(kEndOfStream)),
        poses_(tracker_.Advertise(kPose)) {
    tracker_.Subscribe(kFeatures, [this](const FeatureFrame& frame) {
      received_.push_back(frame);
      poses_.Publish({.frame = frame.frame});
    });
    tracker_.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
      if (end.stage == StageKind::kReassembler) end_of_features_ = end;
    });
  }

  void SendAll() {
    calibration_.Publish(kRig);
    for (int64_t id = 0; id < kNumFrames; ++id) frames_.Publish(Frame(id));
    end_.Publish({.stage = StageKind::kCamera, .num_frames = kNumFrames});
  }
  // The end may overtake the last frames, which travel on a channel of their own.
  bool Ended() const { return end_of_features_.has_value() && received_.size() >= kNumFrames; }
  size_t num_received() const { return received_.size(); }

  void ExpectAll(const std::vector<FeatureFrame>& expected) const {
    ASSERT_EQ(received_.size(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(received_[i].frame, expected[i].frame);
      EXPECT_EQ(received_[i].keypoints, expected[i].keypoints);
      EXPECT_EQ(received_[i].depth_delay_us, Frame(received_[i].frame.value).depth_delay_us);
      EXPECT_EQ(received_[i].descriptors, expected[i].descriptors);
      EXPECT_EQ(received_[i].calibration, kRig);
    }
    EXPECT_EQ(end_of_features_->num_frames, kNumFrames);
    EXPECT_EQ(end_of_features_->num_dropped, 0);
  }

 private:
  StageContext& camera_;
  StageContext& tracker_;
  Publisher<CameraFrame> frames_;
  Publisher<CameraCalibration> calibration_;
  Publisher<EndOfStream> end_;
  Publisher<PoseEstimate> poses_;
  std::vector<FeatureFrame> received_;
  std::optional<EndOfStream> end_of_features_;
};

Settings WithTiles(const std::string& tiles) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("dispatcher.tiles=" + tiles);
  return settings;
}

void StartStages(MemoryBus& bus, int num_extractors) {
  bus.Start<ReassemblerStage>("reassembler");
  bus.Start<DispatcherStage>("dispatcher");
  for (int id = 0; id < num_extractors; ++id) {
    bus.Start<ExtractorStage>("extractor_" + std::to_string(id), id);
  }
}

TEST(Pipeline, FeaturesAreTheSameForEveryCutAndPool) {
  const std::vector<FeatureFrame> expected = Expected();
  ASSERT_GT(expected[0].keypoints.size(), 200U);
  for (const auto& [tiles, num_extractors] : {std::pair("1x1", 1), std::pair("2x2", 2), std::pair("2x8", 4)}) {
    MemoryBus bus(WithTiles(tiles));
    Ends ends(bus);
    StartStages(bus, num_extractors);
    ends.SendAll();
    ASSERT_TRUE(bus.RunUntil([&] { return ends.Ended(); })) << tiles;
    ends.ExpectAll(expected);
  }
}

TEST(Pipeline, LossOnEveryChannelIsRepaired) {
  const std::vector<FeatureFrame> expected = Expected();
  for (unsigned seed = 0; seed < 3; ++seed) {
    MemoryBus bus(WithTiles("2x2"));
    std::mt19937 generator(seed);
    bus.LoseMessages([&](const std::string&) { return generator() % 10 == 0; });
    Ends ends(bus);
    StartStages(bus, 2);
    ends.SendAll();
    ASSERT_TRUE(bus.RunUntil([&] { return ends.Ended(); })) << "seed " << seed;
    ends.ExpectAll(expected);
  }
}

TEST(Pipeline, AKilledExtractorLosesNoWork) {
  const std::vector<FeatureFrame> expected = Expected();
  MemoryBus bus(WithTiles("2x4"));
  Ends ends(bus);
  StartStages(bus, 3);
  ends.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return ends.num_received() >= 2; }));
  bus.Kill("extractor_1");
  ASSERT_TRUE(bus.RunUntil([&] { return ends.num_received() >= 5; }));
  bus.Kill("extractor_0");
  bus.Start<ExtractorStage>("extractor_0", 0);
  ASSERT_TRUE(bus.RunUntil([&] { return ends.Ended(); }));
  ends.ExpectAll(expected);
}

}  // namespace
}  // namespace tessera
