// The occupancy stage on a bus: from what the camera, the tracker and the mapper publish to the files of the run.
#include "stages/occupancy/occupancy_stage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "core/files.h"
#include "messages/tracking_types.h"
#include "occupancy/occupancy_states.h"
#include "stages/map_writer/map_writer_stage.h"
#include "support/depth_room.h"
#include "support/map_changes.h"
#include "support/memory_bus.h"
#include "support/run_folder.h"

namespace tessera {
namespace {

constexpr int64_t kNumKeyframes = 6;
constexpr Rgb kPaint{200, 100, 50};
const std::vector<std::string> kFiles = {"occupancy.bt", "occupancy.ot", "occupancy.pgm", "occupancy.yaml"};

Rigid3 PoseOf(int64_t keyframe) { return CameraAt({0.1, 0.0, -0.2}, 0.4 * static_cast<double>(keyframe)); }

// Stands for the camera, the tracker and the mapper of a run whose every second frame is a keyframe.
class Publishers {
 public:
  explicit Publishers(MemoryBus& bus)
      : camera_(bus.AddContext("camera")),
        tracker_(bus.AddContext("tracker")),
        mapper_(bus.AddContext("mapper")),
        frames_(camera_.Advertise(kCamera)),
        colors_(camera_.Advertise(kColor)),
        poses_(tracker_.Advertise(kPose)),
        keyframes_(tracker_.Advertise(kKeyframe)),
        deltas_(mapper_.Advertise(kMapDelta)),
        tracker_end_(tracker_.Advertise(kEndOfStream)),
        mapper_end_(mapper_.Advertise(kEndOfStream)),
        snapshots_(mapper_.Advertise(kMapSnapshot)) {
    mapper_.Subscribe(kMapRequest, [this](const MapRequest&) {
      if (map_.next_delta() > 0) snapshots_.Publish({.page = 0, .num_pages = 1, .part = map_.Snapshot()});
    });
  }

  void SendKeyframe(int64_t id) {
    CameraFrame image = DepthFrameOf(PoseOf(id));
    for (const int64_t frame : {2 * id, 2 * id + 1}) {
      image.id = {frame};
      frames_.Publish(image);
      poses_.Publish({.frame = {frame}, .is_keyframe = frame % 2 == 0});
    }
    KeyframeObservation keyframe{.id = {id}};
    keyframe.features.frame = {2 * id};
    keyframe.features.calibration = kDepthCamera;
    keyframes_.Publish(keyframe);
    MapDelta delta;
    delta.answers = {id};
    delta.new_keyframes.push_back({{id}, {id - 1}, PoseOf(id), std::make_shared<FeatureFrame>(keyframe.features)});
    Send(delta);
  }
  // An empty image: there is none.
  void SendColor(int64_t id, const ColorImage& image) { colors_.Publish({.id = {2 * id}, .image = image}); }
  void MoveAll() {
    MapDelta delta;
    delta.answers = {kNumKeyframes - 1};
    for (int64_t id = 0; id < kNumKeyframes; ++id) {
      delta.moved_keyframes.push_back({{id}, Rigid3{ExpSO3({0, 0.02, 0}), {0.2, 0, 0}} * PoseOf(id)});
    }
    Send(delta);
  }
  void End() {
    tracker_end_.Publish({.stage = StageKind::kTracker, .num_frames = 2 * kNumKeyframes, .num_values = kNumKeyframes});
    mapper_end_.Publish({.stage = StageKind::kMapper, .num_values = map_.next_delta()});
  }

  // The occupancy map of these keyframes, made at once.
  OccupancyMap Expected() const {
    OccupancyMap occupancy(RoomOptions());
    map_.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
      occupancy.Put(id, ScanOfRoom(PoseOf(id.value)), keyframe.world_from_camera);
    });
    return occupancy;
  }

 private:
  void Send(const MapDelta& change) {
    const MapDelta delta = WithHash(map_, change);
    ASSERT_TRUE(map_.Apply(delta));
    deltas_.Publish(delta);
  }

  StageContext& camera_;
  StageContext& tracker_;
  StageContext& mapper_;
  Publisher<CameraFrame> frames_;
  Publisher<ColorFrame> colors_;
  Publisher<PoseEstimate> poses_;
  Publisher<KeyframeObservation> keyframes_;
  Publisher<MapDelta> deltas_;
  Publisher<EndOfStream> tracker_end_, mapper_end_;
  Publisher<MapSnapshotPage> snapshots_;
  Map map_;
};

Settings RoomSettings(const RunFolder& folder) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("camera.sensor=rgbd");
  settings.Override("occupancy.resolution_m=" + std::to_string(RoomOptions().resolution));
  settings.Override("evaluator.out_dir=" + folder.File("run"));
  return settings;
}

TEST(OccupancyStage, WritesTheMapOfAllKeyframesAtTheirFinalPosesAlsoWhereMessagesAreLost) {
  for (const bool loses : {false, true}) {
    const RunFolder folder;
    MemoryBus bus(RoomSettings(folder));
    std::mt19937 generator(3);
    if (loses) bus.LoseMessages([&](const std::string&) { return generator() % 10 == 0; });
    Publishers publishers(bus);
    bus.Start<OccupancyStage>("occupancy");
    for (int64_t id = 0; id < kNumKeyframes; ++id) publishers.SendKeyframe(id);
    bus.RunUntilQuiet();
    publishers.MoveAll();
    publishers.End();
    ASSERT_TRUE(bus.RunUntil([&] { return std::filesystem::exists(folder.File("run/occupancy.bt")); })) << loses;
    const OccupancyMap expected = publishers.Expected();
    OccupancyStates states(expected.options().resolution);
    states.Set(expected.Blocks());
    EXPECT_EQ(ReadFile(folder.File("run/occupancy.bt")), states.BinaryTreeFile()) << loses;
    EXPECT_EQ(ReadFile(folder.File("run/occupancy.ot")), expected.ColorTreeFile()) << loses;
    for (const std::string& name : kFiles) EXPECT_TRUE(std::filesystem::exists(folder.File("run/" + name))) << name;
  }
}

TEST(OccupancyStage, WhoComesLateGetsTheWholeMap) {
  const RunFolder folder;
  MemoryBus bus(RoomSettings(folder));
  Publishers publishers(bus);
  bus.Start<OccupancyStage>("occupancy");
  for (int64_t id = 0; id < kNumKeyframes; ++id) publishers.SendKeyframe(id);
  bus.RunUntilQuiet();
  StageContext& listener = bus.AddContext("listener");
  std::optional<OccupancyUpdate> whole;
  listener.Subscribe(kOccupancy, [&](const OccupancyUpdate& update) {
    if (update.is_whole) whole = update;
  });
  listener.Advertise(kOccupancyRequest).Publish({});
  ASSERT_TRUE(bus.RunUntil([&] { return whole.has_value(); }));
  EXPECT_EQ(whole->num_keyframes, kNumKeyframes);
  EXPECT_EQ(whole->blocks, publishers.Expected().Blocks());
}

TEST(OccupancyStage, TheMapWriterWritesWhatItKnowsOfARunningStack) {
  const RunFolder folder;
  MemoryBus bus(RoomSettings(folder));
  Publishers publishers(bus);
  bus.Start<OccupancyStage>("occupancy");
  for (int64_t id = 0; id < kNumKeyframes; ++id) publishers.SendKeyframe(id);
  bus.RunUntilQuiet();
  bus.Start<MapWriterStage>("tree_writer", 0, {"map_writer.path=" + folder.File("now.bt")});
  bus.Start<MapWriterStage>("color_writer", 0, {"map_writer.path=" + folder.File("now.ot")});
  bus.Start<MapWriterStage>("grid_writer", 0, {"map_writer.path=" + folder.File("now.pgm")});
  const auto exists = [&](const std::string& name) { return std::filesystem::exists(folder.File(name)); };
  ASSERT_TRUE(
      bus.RunUntil([&] { return exists("now.bt") && exists("now.ot") && exists("now.pgm") && exists("now.yaml"); }));
  OccupancyStates states(RoomOptions().resolution);
  states.Set(publishers.Expected().Blocks());
  EXPECT_EQ(ReadFile(folder.File("now.bt")), states.BinaryTreeFile());
  EXPECT_EQ(ReadFile(folder.File("now.ot")), states.ColorTreeFile());
  EXPECT_THAT(ReadFile(folder.File("now.yaml")), testing::HasSubstr("image: now.pgm\n"));
}

TEST(OccupancyStage, TellsColorsWhereTheRunHasThem) {
  for (const bool has_color : {false, true}) {
    const RunFolder folder;
    Settings settings = RoomSettings(folder);
    settings.Override("camera.color=true");
    MemoryBus bus(settings);
    Publishers publishers(bus);
    std::vector<OccupancyUpdate> told;
    bus.AddContext("listener").Subscribe(kOccupancy, [&](const OccupancyUpdate& update) { told.push_back(update); });
    bus.Start<OccupancyStage>("occupancy");
    publishers.SendKeyframe(0);
    publishers.SendColor(0, has_color ? Painted(kPaint) : ColorImage());
    ASSERT_TRUE(bus.RunUntil([&] { return !told.empty(); }));
    size_t num_occupied = 0;
    for (const OccupancyBlock& block : told.front().blocks) num_occupied += block.NumOccupied();
    EXPECT_GT(num_occupied, 0U);
    EXPECT_EQ(told.front().colors, std::vector<Rgb>(has_color ? num_occupied : 0, kPaint));
  }
}

TEST(OccupancyStage, WithoutOneTheMapWriterSaysSo) {
  const RunFolder folder;
  MemoryBus bus(RoomSettings(folder));
  Publishers publishers(bus);
  publishers.SendKeyframe(0);
  bus.Start<MapWriterStage>("writer", 0, {"map_writer.path=" + folder.File("now.bt")});
  ASSERT_TRUE(bus.RunUntil([&] { return bus.exit_status("writer") == 1; }));
  EXPECT_THAT(bus.failure("writer"), testing::HasSubstr("--occupancy"));
}

TEST(OccupancyStage, ItsChangesPutTogetherAreItsMap) {
  const RunFolder folder;
  MemoryBus bus(RoomSettings(folder));
  Publishers publishers(bus);
  OccupancyStates told(RoomOptions().resolution);
  bus.AddContext("listener").Subscribe(kOccupancy, [&](const OccupancyUpdate& update) { told.Set(update.blocks); });
  bus.Start<OccupancyStage>("occupancy");
  for (int64_t id = 0; id < kNumKeyframes; ++id) {
    publishers.SendKeyframe(id);
    bus.RunUntilQuiet();
  }
  publishers.MoveAll();
  publishers.End();
  ASSERT_TRUE(bus.RunUntil([&] { return std::filesystem::exists(folder.File("run/occupancy.bt")); }));
  bus.RunUntilQuiet();
  EXPECT_EQ(told.BinaryTreeFile(), ReadFile(folder.File("run/occupancy.bt")));
}

TEST(OccupancyStage, SettingsThatDoNotFitTheSensorEndIt) {
  const RunFolder folder;
  Settings settings = RoomSettings(folder);
  settings.Override("occupancy.resolution_m=5");
  MemoryBus bus(settings);
  Publishers publishers(bus);
  bus.Start<OccupancyStage>("occupancy");
  publishers.SendKeyframe(0);
  ASSERT_TRUE(bus.RunUntil([&] { return bus.exit_status("occupancy") == 2; }));
  EXPECT_THAT(bus.failure("occupancy"), testing::HasSubstr("maximum range"));
}

}  // namespace
}  // namespace tessera
