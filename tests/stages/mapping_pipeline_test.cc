// The whole pipeline with tracker, mapper and evaluator in one process: the same two hashes whatever
// happens on the way, and late listeners that reach the mapper's map.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "evaluation/map_ply.h"
#include "map/map.h"
#include "stages/dispatcher/dispatcher_stage.h"
#include "stages/evaluator/evaluator_stage.h"
#include "stages/extractor/extractor_stage.h"
#include "stages/map_writer/map_writer_stage.h"
#include "stages/mapper/mapper_stage.h"
#include "stages/reassembler/reassembler_stage.h"
#include "stages/tracker/tracker_stage.h"
#include "support/memory_bus.h"
#include "support/run_folder.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

// The channel, for a second publisher.
template <class Value>
Topic<Value> Shared(Topic<Value> topic) {
  topic.publishers = Publishers::kMany;
  return topic;
}

namespace fs = std::filesystem;

constexpr int64_t kNumFrames = 50;

Settings SettingsOf(const RunFolder& folder, const std::string& tiles) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("dispatcher.tiles=" + tiles);
  settings.Override("features.num_features=600");
  settings.Override("tracker.keyframe_min_share_with_depth=0.9");  // a short way, and yet many keyframes
  settings.Override("tracker.relocalize=false");                   // nobody is there to answer
  settings.Override("mapper.close_loops=false");
  settings.Override("evaluator.out_dir=" + folder.path());
  settings.Override("map_writer.path=" + folder.File("late.ply"));
  settings.Override("map_writer.follow=true");
  return settings;
}

// One run, with a camera that keeps a few frames ahead of the poses.
class StackRun {
 public:
  explicit StackRun(const std::string& tiles = "1x1", int num_extractors = 1)
      : bus_(SettingsOf(folder_, tiles)), camera_(bus_.AddContext("camera")) {
    frames_ = camera_.Advertise(kCamera);
    calibration_ = camera_.Advertise(kCalibration);
    end_ = camera_.Advertise(kEndOfStream);
    camera_.Subscribe(kPose, [this](const PoseEstimate& pose) {
      poses_.push_back(pose);
      SendMore();
    });
    camera_.Subscribe(kStatus, [this](const StageStatus& status) { statuses_[status.name] = status; });
    bus_.Start<EvaluatorStage>("evaluator");
    bus_.Start<MapperStage>("mapper");
    bus_.Start<TrackerStage>("tracker");
    bus_.Start<ReassemblerStage>("reassembler");
    bus_.Start<DispatcherStage>("dispatcher");
    for (int id = 0; id < num_extractors; ++id) bus_.Start<ExtractorStage>("extractor_" + std::to_string(id), id);
  }

  void Begin() {
    calibration_.Publish(MovingScene::Calibration());
    SendMore();
  }
  bool Reach(size_t num_poses) {
    return bus_.RunUntil([&] { return poses_.size() >= num_poses; });
  }
  bool Finish() {
    return bus_.RunUntil([&] { return fs::exists(folder_.File("run.json")); });
  }
  nlohmann::json Figures() const { return nlohmann::json::parse(folder_.Read("run.json")); }

  MemoryBus& bus() { return bus_; }
  const RunFolder& folder() const { return folder_; }
  const std::vector<PoseEstimate>& poses() const { return poses_; }
  const StageStatus& status(const std::string& name) { return statuses_[name]; }

 private:
  void SendMore() {
    const int64_t end = std::min(kNumFrames, static_cast<int64_t>(poses_.size()) + 6);
    for (; next_ < end; ++next_) frames_.Publish(scene_.Frame(next_));
    if (next_ == kNumFrames && !has_ended_) {
      has_ended_ = true;
      end_.Publish({.stage = StageKind::kCamera, .num_frames = kNumFrames});
    }
  }

  RunFolder folder_;
  MemoryBus bus_;
  StageContext& camera_;
  MovingScene scene_;
  Publisher<CameraFrame> frames_;
  Publisher<CameraCalibration> calibration_;
  Publisher<EndOfStream> end_;
  std::vector<PoseEstimate> poses_;
  std::map<std::string, StageStatus> statuses_;
  int64_t next_ = 0;
  bool has_ended_ = false;
};

// Figures of the run that no other may differ from.
const nlohmann::json& Reference() {
  static const nlohmann::json reference = [] {
    StackRun run;
    run.Begin();
    EXPECT_TRUE(run.Finish());
    return run.Figures();
  }();
  return reference;
}

void ExpectSame(const nlohmann::json& figures) {
  for (const char* key :
       {"frames", "frames_tracked", "frames_dropped", "keyframes", "landmarks", "trajectory_sha256", "map_sha256"}) {
    EXPECT_EQ(figures[key], Reference()[key]) << key;
  }
}

TEST(MappingPipeline, TracksAndMaps) {
  const nlohmann::json& figures = Reference();
  EXPECT_EQ(figures["frames"], kNumFrames);
  EXPECT_EQ(figures["frames_tracked"], kNumFrames);
  EXPECT_EQ(figures["tracking_failures"], 0);
  EXPECT_GT(figures["keyframes"], 4);
  EXPECT_GT(figures["landmarks"], 200);
  EXPECT_GT(figures["stage_ms"]["mapper"]["median"], 0.0);
}

TEST(MappingPipeline, PosesFollowTheCamera) {
  StackRun run;
  run.Begin();
  ASSERT_TRUE(run.Finish());
  std::istringstream rows(run.folder().Read("trajectory.txt"));
  std::string comment;
  std::getline(rows, comment);
  double time = 0, x = 0, y = 0, z = 0, q[4];
  for (int64_t frame = 0; frame < kNumFrames; ++frame) {
    ASSERT_TRUE(rows >> time >> x >> y >> z >> q[0] >> q[1] >> q[2] >> q[3]) << frame;
    // 2 % of the whole way. Sideways motion along walls is hard to tell from a turn.
    const double max_error_m = 0.02 * MovingScene::kStepM * kNumFrames;
    EXPECT_NEAR(x, MovingScene::kStepM * static_cast<double>(frame), max_error_m) << frame;
    EXPECT_NEAR(std::hypot(y, z), 0.0, max_error_m) << frame;
  }
}

TEST(MappingPipeline, HashesAreTheSameForEveryCutAndPool) {
  for (const auto& [tiles, num_extractors] : {std::pair("2x2", 2), std::pair("2x4", 3)}) {
    StackRun run(tiles, num_extractors);
    run.Begin();
    ASSERT_TRUE(run.Finish()) << tiles;
    ExpectSame(run.Figures());
  }
}

TEST(MappingPipeline, HashesAreTheSameUnderLoss) {
  for (unsigned seed = 0; seed < 3; ++seed) {
    StackRun run("2x2", 2);
    std::mt19937 generator(seed);
    run.bus().LoseMessages([&](const std::string&) { return generator() % 10 == 0; });
    run.Begin();
    ASSERT_TRUE(run.Finish()) << "seed " << seed;
    ExpectSame(run.Figures());
    EXPECT_GT(run.Figures()["messages_repaired"], 0);
  }
}

TEST(MappingPipeline, HashesAreTheSameWhenExtractorsDie) {
  StackRun run("2x4", 3);
  run.Begin();
  ASSERT_TRUE(run.Reach(5));
  run.bus().Kill("extractor_1");
  ASSERT_TRUE(run.Reach(20));
  run.bus().Kill("extractor_0");
  run.bus().Start<ExtractorStage>("extractor_0", 0);
  ASSERT_TRUE(run.Finish());
  ExpectSame(run.Figures());
}

TEST(MappingPipeline, AKilledMapperBuildsTheSameMapAgain) {
  for (const size_t num_poses : {size_t{1}, size_t{18}, size_t{37}}) {
    StackRun run;
    std::mt19937 generator(2);
    run.bus().LoseMessages([&](const std::string&) { return generator() % 20 == 0; });
    run.Begin();
    ASSERT_TRUE(run.Reach(num_poses));
    run.bus().Kill("mapper");
    run.bus().Start<MapperStage>("mapper");
    ASSERT_TRUE(run.Finish()) << num_poses;
    ExpectSame(run.Figures());
  }
}

TEST(MappingPipeline, AFrameSeesExactlyTheDeltasOfItsStep) {
  StackRun run;
  run.Begin();
  ASSERT_TRUE(run.Finish());
  const int64_t delay = 3;  // tracker.map_delay_frames
  for (const PoseEstimate& pose : run.poses()) {
    int64_t num_due = 0;
    for (const PoseEstimate& earlier : run.poses()) {
      num_due += earlier.is_keyframe && earlier.frame.value <= pose.frame.value - delay ? 1 : 0;
    }
    EXPECT_EQ(pose.num_deltas, num_due) << pose.frame.value;
    EXPECT_FALSE(pose.is_live);
  }
}

TEST(MappingPipeline, WhoComesLateReachesTheMappersMap) {
  for (const size_t num_poses : {size_t{2}, size_t{15}, size_t{38}}) {
    StackRun run;
    std::mt19937 generator(1);
    run.bus().LoseMessages(
        [&](const std::string& channel) { return channel.starts_with("MAP_") && generator() % 5 == 0; });
    run.Begin();
    ASSERT_TRUE(run.Reach(num_poses));
    run.bus().Start<MapWriterStage>("map_writer");
    ASSERT_TRUE(run.Finish());
    ASSERT_TRUE(run.bus().RunUntil([&] { return fs::exists(run.folder().File("late.ply")); })) << num_poses;
    EXPECT_EQ(run.folder().Read("late.ply"), run.folder().Read("map.ply"));
    ExpectSame(run.Figures());
  }
}

TEST(MappingPipeline, AWrongDeltaIsReportedAndASnapshotMendsIt) {
  StackRun run;
  StageContext& liar = run.bus().AddContext("liar");
  const auto deltas = liar.Advertise(Shared(kMapDelta));
  liar.Subscribe(kMapDelta, [&](const MapDelta& delta, const MessageInfo& info) {
    // So far ahead that it comes before the true one: logical time lets no more than a few be on their way.
    if (info.publisher == "mapper" && delta.number == 2) deltas.Publish({.number = 8, .answers = {8}, .hash = 7});
  });
  run.Begin();
  ASSERT_TRUE(run.Finish());
  EXPECT_EQ(run.Figures()["map_sha256"].get<std::string>().size(), 64U);
  EXPECT_EQ(run.Figures()["frames_tracked"], kNumFrames);
  ASSERT_TRUE(run.bus().RunUntil([&] { return run.status("tracker").state == StageState::kFinished; }));
  for (const char* name : {"evaluator", "tracker"}) {
    EXPECT_NE(run.status(name).last_error.find("wrong hash"), std::string::npos) << name;
  }
}

TEST(MappingPipeline, AKeyframeOutOfTurnEndsTheMapperWithASentence) {
  StackRun run;
  StageContext& other = run.bus().AddContext("other");
  const auto keyframes = other.Advertise(Shared(kKeyframe));
  run.Begin();
  ASSERT_TRUE(run.Reach(3));
  KeyframeObservation keyframe;
  keyframe.id = {77};
  keyframe.features.calibration = MovingScene::Calibration();
  keyframe.features.frame = {5};
  keyframes.Publish(keyframe);
  ASSERT_TRUE(run.bus().RunUntil([&] { return run.bus().exit_status("mapper") != 0; }));
  EXPECT_NE(run.bus().failure("mapper").find("keyframe 77"), std::string::npos);
}

}  // namespace
}  // namespace tessera
