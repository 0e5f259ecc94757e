// Several robots and one pool of extractors, in one process: what each gets is what it gets alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "core/errors.h"
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

struct Robot {
  std::string prefix;
  std::string tiles;
  SensorType sensor = SensorType::kMono;
  int width_px = 320;
  int height_px = 240;
  int num_frames = 10;
  unsigned seed = 0;  // of its images
};
const Robot kStereoRobot{.prefix = "a_", .tiles = "1x1", .sensor = SensorType::kStereo, .seed = 100};
const Robot kMonoRobot{
    .prefix = "b_", .tiles = "2x4", .width_px = 200, .height_px = 160, .num_frames = 14, .seed = 200};

CameraCalibration CalibrationOf(const Robot& robot) {
  return {.sensor = robot.sensor,
          .width_px = robot.width_px,
          .height_px = robot.height_px,
          .fx_px = 300,
          .fy_px = 300,
          .cx_px = 0.5 * robot.width_px,
          .cy_px = 0.5 * robot.height_px,
          .baseline_m = robot.sensor == SensorType::kStereo ? 0.1 : 0.0};
}

CameraFrame FrameOf(const Robot& robot, int64_t id) {
  CameraFrame frame;
  frame.id = {id};
  frame.utime_us = 100'000 * id;
  frame.sensor = robot.sensor;
  frame.left = RectanglesImage(robot.width_px, robot.height_px, robot.seed + static_cast<unsigned>(id));
  if (robot.sensor == SensorType::kStereo) {
    frame.right = frame.left;
    std::rotate(frame.right.pixels.begin(), frame.right.pixels.begin() + 8, frame.right.pixels.end());
  }
  return frame;
}

std::vector<FeatureFrame> FeaturesAlone(const Robot& robot) {
  std::vector<FeatureFrame> frames;
  Extractor extractor;
  for (int64_t id = 0; id < robot.num_frames; ++id) {
    std::vector<TileFeatures> tiles;
    for (const TileJob& job : CutFrame(FrameOf(robot, id), CalibrationOf(robot), 0, {}, 4, FeatureOptions{})) {
      tiles.push_back(extractor.Extract(job));
    }
    frames.push_back(SelectFeatures(tiles).value().features);
  }
  return frames;
}

// A robot's own processes: camera and tracker are this, dispatcher and reassembler the real ones.
class RobotStack {
 public:
  RobotStack(MemoryBus& bus, Robot robot) : bus_(bus), robot_(std::move(robot)) {
    const std::vector<std::string> own{"bus.channel_prefix=" + robot_.prefix, "dispatcher.tiles=" + robot_.tiles};
    bus.Start<ReassemblerStage>(robot_.prefix + "reassembler", 0, own);
    bus.Start<DispatcherStage>(robot_.prefix + "dispatcher", 0, own);
    StageContext& camera = bus.AddContext(robot_.prefix + "camera", 0, own);
    frames_ = camera.Advertise(kCamera);
    calibration_ = camera.Advertise(kCalibration);
    end_ = camera.Advertise(kEndOfStream);
    StageContext& tracker = bus.AddContext(robot_.prefix + "tracker", 0, own);
    poses_ = tracker.Advertise(kPose);
    tracker.Subscribe(kFeatures, [this](const FeatureFrame& frame) {
      received_.push_back(frame);
      poses_.Publish({.frame = frame.frame});
    });
    tracker.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
      if (end.stage == StageKind::kReassembler) features_ended_ = true;
    });
  }

  void SendAll() {
    calibration_.Publish(CalibrationOf(robot_));
    for (int64_t id = 0; id < robot_.num_frames; ++id) frames_.Publish(FrameOf(robot_, id));
    end_.Publish({.stage = StageKind::kCamera, .num_frames = robot_.num_frames});
  }
  void Kill() {
    for (const char* stage : {"reassembler", "dispatcher", "camera", "tracker"}) bus_.Kill(robot_.prefix + stage);
  }

  size_t num_received() const { return received_.size(); }
  bool Ended() const { return features_ended_ && received_.size() >= static_cast<size_t>(robot_.num_frames); }
  void ExpectAsAlone() const {
    const std::vector<FeatureFrame> alone = FeaturesAlone(robot_);
    ASSERT_EQ(received_.size(), alone.size()) << robot_.prefix;
    for (size_t i = 0; i < alone.size(); ++i) {
      EXPECT_EQ(received_[i].frame, alone[i].frame);
      EXPECT_TRUE(received_[i].keypoints == alone[i].keypoints) << robot_.prefix << ", frame " << i;
      EXPECT_TRUE(received_[i].descriptors == alone[i].descriptors) << robot_.prefix << ", frame " << i;
    }
  }

 private:
  MemoryBus& bus_;
  const Robot robot_;
  Publisher<CameraFrame> frames_;
  Publisher<CameraCalibration> calibration_;
  Publisher<EndOfStream> end_;
  Publisher<PoseEstimate> poses_;
  std::vector<FeatureFrame> received_;
  bool features_ended_ = false;
};

Settings Defaults() { return Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml"); }

void StartPoolMember(MemoryBus& bus, int id) {
  bus.Start<ExtractorStage>("extractor_" + std::to_string(id), id, {"extractor.robots=a_,b_"});
}

TEST(Robots, ThatShareExtractorsGetWhatTheyGetAlone) {
  for (const int num_extractors : {1, 4}) {
    MemoryBus bus(Defaults());
    for (int id = 0; id < num_extractors; ++id) StartPoolMember(bus, id);
    RobotStack a(bus, kStereoRobot);
    RobotStack b(bus, kMonoRobot);
    a.SendAll();
    b.SendAll();
    ASSERT_TRUE(bus.RunUntil([&] { return a.Ended() && b.Ended(); })) << num_extractors;
    a.ExpectAsAlone();
    b.ExpectAsAlone();
  }
}

TEST(Robots, LossesAndDeathsOfExtractorsChangeNothing) {
  MemoryBus bus(Defaults());
  std::mt19937 generator(1);
  bus.LoseMessages([&](const std::string&) { return generator() % 10 == 0; });
  for (int id = 0; id < 3; ++id) StartPoolMember(bus, id);
  RobotStack a(bus, kStereoRobot);
  RobotStack b(bus, kMonoRobot);
  a.SendAll();
  b.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return a.num_received() >= 3; }));
  bus.Kill("extractor_1");
  ASSERT_TRUE(bus.RunUntil([&] { return b.num_received() >= 6; }));
  bus.Kill("extractor_0");
  StartPoolMember(bus, 0);
  ASSERT_TRUE(bus.RunUntil([&] { return a.Ended() && b.Ended(); }));
  a.ExpectAsAlone();
  b.ExpectAsAlone();
}

TEST(Robots, MayComeAndGoAndComeAgain) {
  MemoryBus bus(Defaults());
  for (int id = 0; id < 2; ++id) StartPoolMember(bus, id);
  RobotStack a(bus, kStereoRobot);
  a.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return a.num_received() >= 2; }));
  RobotStack b(bus, kMonoRobot);  // comes while the other works
  b.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return a.Ended() && b.Ended(); }));
  a.ExpectAsAlone();
  b.ExpectAsAlone();
  a.Kill();
  bus.RunUntilQuiet(3.0);
  Robot other_way = kStereoRobot;
  other_way.seed = 300;
  RobotStack again(bus, other_way);  // other images under the same frame numbers
  again.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return again.Ended(); }));
  again.ExpectAsAlone();
}

// Its jobs wait in the extractors, and their answers come when the next run has begun.
TEST(Robots, AKilledOneStartsAnewAndGetsNoAnswerToOldJobs) {
  for (const size_t num_received : {1U, 4U}) {
    MemoryBus bus(Defaults());
    for (int id = 0; id < 2; ++id) StartPoolMember(bus, id);
    RobotStack b(bus, kMonoRobot);
    b.SendAll();
    auto a = std::make_unique<RobotStack>(bus, kStereoRobot);
    a->SendAll();
    ASSERT_TRUE(bus.RunUntil([&] { return a->num_received() >= num_received; }));
    a->Kill();
    bus.RunUntil([rounds = 0]() mutable { return ++rounds > 1; });  // what its camera had sent is not for its successor
    Robot other_way = kStereoRobot;
    other_way.seed = 300;
    RobotStack again(bus, other_way);
    again.SendAll();
    ASSERT_TRUE(bus.RunUntil([&] { return again.Ended() && b.Ended(); })) << num_received;
    again.ExpectAsAlone();
    b.ExpectAsAlone();
  }
}

// A robot brings an extractor with the name of one of the pool.
TEST(Robots, ANamesakeUnderOnePrefixLeavesTheOtherRobotsAlone) {
  MemoryBus bus(Defaults());
  bus.Start<ExtractorStage>("extractor_0", 0, {"bus.channel_prefix=a_"});
  bus.RunUntilQuiet(0.5);
  bus.Start<ExtractorStage>("extractor_0", 0, {"extractor.robots=a_,b_"});
  RobotStack a(bus, kStereoRobot);
  RobotStack b(bus, kMonoRobot);
  a.SendAll();
  b.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return a.Ended() && b.Ended(); }));
  a.ExpectAsAlone();
  b.ExpectAsAlone();
}

TEST(Robots, AListOfThemThatMakesNoSenseIsRefused) {
  for (const std::string robots : {",", "a_,,b_", "a_,a_", "a b", "own_"}) {
    MemoryBus bus(Defaults());
    EXPECT_THROW(bus.Start<ExtractorStage>("extractor_0", 0, {"extractor.robots=" + robots, "bus.channel_prefix=own_"}),
                 InputError)
        << robots;
  }
}

// One robot's images have 4.8 times the pixels of the other's, and both send more than the extractor can do.
TEST(Robots, GetEqualSharesOfPixelsWhileBothHaveWork) {
  Settings settings = Defaults();
  settings.Override("dispatcher.max_queued_frames=200");
  MemoryBus bus(settings);
  StartPoolMember(bus, 0);
  Robot large = kStereoRobot, small = kMonoRobot;
  large.num_frames = 14;
  small.num_frames = 80;
  small.tiles = "1x1";
  RobotStack a(bus, large);
  RobotStack b(bus, small);
  a.SendAll();
  b.SendAll();
  ASSERT_TRUE(bus.RunUntil([&] { return a.num_received() == 2; }));
  const size_t b_before = b.num_received();
  ASSERT_TRUE(bus.RunUntil([&] { return a.num_received() == 12; }));
  EXPECT_NEAR(static_cast<double>(b.num_received() - b_before), 48.0, 8.0);
}

}  // namespace
}  // namespace tessera
