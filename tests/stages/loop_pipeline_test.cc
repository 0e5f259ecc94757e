// The whole pipeline with loop closer and global adjuster in one process: a camera that is carried off,
// begins another part of the map, and comes back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "stages/dispatcher/dispatcher_stage.h"
#include "stages/evaluator/evaluator_stage.h"
#include "stages/extractor/extractor_stage.h"
#include "stages/global_adjuster/global_adjuster_stage.h"
#include "stages/loop_closer/loop_closer_stage.h"
#include "stages/mapper/mapper_stage.h"
#include "stages/reassembler/reassembler_stage.h"
#include "stages/tracker/tracker_stage.h"
#include "support/memory_bus.h"
#include "support/run_folder.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

constexpr int kNumFirst = 20;      // frames of the first part, a step each
constexpr int kFarStep = 200;      // to where the camera is carried then: nothing of the first part is in sight
constexpr int kStepsPerFrame = 2;  // on the way back
constexpr int64_t kNumFrames = kNumFirst + kFarStep / kStepsPerFrame;

int StepOf(int64_t frame) {
  const auto i = static_cast<int>(frame);
  return i < kNumFirst ? i : kFarStep - kStepsPerFrame * (i - kNumFirst);
}

using Overrides = std::vector<std::string>;

Settings SettingsOf(const RunFolder& folder, const std::string& tiles, const Overrides& overrides) {
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("dispatcher.tiles=" + tiles);
  settings.Override("features.num_features=600");
  settings.Override("tracker.keyframe_min_share_with_depth=0.9");  // a short way, and yet many keyframes
  settings.Override("tracker.max_lost_s=0.3");
  settings.Override("mapper.loop_delay_keyframes=2");
  settings.Override("mapper.adjustment_delay_keyframes=4");
  settings.Override("loop_closer.vocabulary=" TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
  settings.Override("evaluator.out_dir=" + folder.path());
  for (const std::string& text : overrides) settings.Override(text);
  return settings;
}

class LoopRun {
 public:
  explicit LoopRun(const std::string& tiles = "1x1", int num_extractors = 1, const Overrides& overrides = {})
      : bus_(SettingsOf(folder_, tiles, overrides)), camera_(bus_.AddContext("camera")) {
    frames_ = camera_.Advertise(kCamera);
    calibration_ = camera_.Advertise(kCalibration);
    end_ = camera_.Advertise(kEndOfStream);
    camera_.Subscribe(kPose, [this](const PoseEstimate& pose) {
      poses_.push_back(pose);
      SendMore();
    });
    camera_.Subscribe(kLoopResult, [this](const LoopResult& result) {
      if (result.matched.valid()) loops_.push_back(result);
    });
    camera_.Subscribe(kGlobalAdjustment, [this](const GlobalAdjustment& adjustment) {
      num_usable_adjustments_ += adjustment.is_usable ? 1 : 0;
    });
    bus_.Start<EvaluatorStage>("evaluator");
    bus_.Start<LoopCloserStage>("loop_closer");
    bus_.Start<GlobalAdjusterStage>("global_adjuster");
    bus_.Start<MapperStage>("mapper");
    bus_.Start<TrackerStage>("tracker");
    bus_.Start<ReassemblerStage>("reassembler");
    bus_.Start<DispatcherStage>("dispatcher");
    for (int id = 0; id < num_extractors; ++id) bus_.Start<ExtractorStage>("extractor_" + std::to_string(id), id);
    calibration_.Publish(MovingScene::Calibration());
    SendMore();
  }

  bool Reach(size_t num_poses) {
    return bus_.RunUntil([&] { return poses_.size() >= num_poses; }, 300.0);
  }
  // Empty if the run did not end.
  nlohmann::json Finish() {
    const std::string path = folder_.File("run.json");
    if (!bus_.RunUntil([&] { return std::filesystem::exists(path); }, 300.0)) return {};
    return nlohmann::json::parse(folder_.Read("run.json"));
  }
  template <class Stage>
  void Restart(const std::string& name) {
    bus_.Kill(name);
    bus_.Start<Stage>(name);
  }

  MemoryBus& bus() { return bus_; }
  const std::vector<PoseEstimate>& poses() const { return poses_; }
  const std::vector<LoopResult>& loops() const { return loops_; }
  int num_usable_adjustments() const { return num_usable_adjustments_; }
  const RunFolder& folder() const { return folder_; }

 private:
  void SendMore() {
    const int64_t end = std::min(kNumFrames, static_cast<int64_t>(poses_.size()) + 6);
    for (; next_ < end; ++next_) frames_.Publish(scene_.Frame(next_, StepOf(next_)));
    if (next_ == kNumFrames && !has_ended_) {
      has_ended_ = true;
      end_.Publish({.stage = StageKind::kCamera, .num_frames = kNumFrames});
    }
  }

  RunFolder folder_;
  MemoryBus bus_;
  StageContext& camera_;
  MovingScene scene_{kFarStep};
  Publisher<CameraFrame> frames_;
  Publisher<CameraCalibration> calibration_;
  Publisher<EndOfStream> end_;
  std::vector<PoseEstimate> poses_;
  std::vector<LoopResult> loops_;
  int num_usable_adjustments_ = 0;
  int64_t next_ = 0;
  bool has_ended_ = false;
};

// In the world of the first frame, wherever a frame belongs: without the loop, the second part would be ten meters off.
void ExpectTruePlaces(const LoopRun& run, int64_t min_poses) {
  std::istringstream rows(run.folder().Read("trajectory.txt"));
  std::string comment;
  std::getline(rows, comment);
  double time_s = 0, x = 0, y = 0, z = 0, q[4];
  int num_poses = 0;
  while (rows >> time_s >> x >> y >> z >> q[0] >> q[1] >> q[2] >> q[3]) {
    const int step = StepOf(std::lround(10.0 * time_s));
    // 2 % of the whole way. Sideways motion along walls is hard to tell from a turn.
    const double max_error_m = 0.02 * MovingScene::kStepM * kFarStep;
    EXPECT_NEAR(x, MovingScene::kStepM * step, max_error_m) << step;
    EXPECT_NEAR(std::hypot(y, z), 0.0, max_error_m) << step;
    ++num_poses;
  }
  EXPECT_GE(num_poses, min_poses);
}

// The run that all others are compared with. Its folder stays until the tests end.
LoopRun& ReferenceRun() {
  static LoopRun run;
  return run;
}

const nlohmann::json& Reference() {
  static const nlohmann::json reference = [] {
    LoopRun& run = ReferenceRun();
    nlohmann::json figures = run.Finish();
    EXPECT_FALSE(run.loops().empty());
    EXPECT_TRUE(!run.loops().empty() && run.loops().front().joins_parts);
    EXPECT_GT(run.num_usable_adjustments(), 0);
    ExpectTruePlaces(run, kNumFrames - 10);
    return figures;
  }();
  return reference;
}

void ExpectSame(const nlohmann::json& figures) {
  ASSERT_FALSE(figures.is_null()) << "the run did not end";
  for (const char* key :
       {"frames", "frames_tracked", "tracking_failures", "keyframes", "landmarks", "trajectory_sha256", "map_sha256"}) {
    EXPECT_EQ(figures[key], Reference()[key]) << key;
  }
}

TEST(LoopPipeline, APartBegunElsewhereIsJoinedWhenTheCameraComesBack) {
  const nlohmann::json& figures = Reference();
  ASSERT_FALSE(figures.is_null());
  EXPECT_EQ(figures["frames"], kNumFrames);
  EXPECT_EQ(figures["tracking_failures"], 1);
  EXPECT_GE(figures["frames_tracked"], kNumFrames - 10);
}

TEST(LoopPipeline, HashesAreTheSameForEveryCutAndPoolAndUnderLoss) {
  LoopRun run("2x2", 3);
  std::mt19937 generator(1);
  run.bus().LoseMessages([&](const std::string&) { return generator() % 20 == 0; });
  ExpectSame(run.Finish());
}

TEST(LoopPipeline, ALoopCloserThatIsStartedAgainSaysTheSame) {
  for (const size_t num_poses : {size_t{30}, size_t{100}}) {
    LoopRun run;
    ASSERT_TRUE(run.Reach(num_poses));
    run.Restart<LoopCloserStage>("loop_closer");
    ExpectSame(run.Finish());
  }
}

TEST(LoopPipeline, AMapperAndAnAdjusterThatAreStartedAgainMakeTheSameMap) {
  LoopRun run;
  ASSERT_TRUE(run.Reach(110));
  run.Restart<MapperStage>("mapper");
  run.Restart<GlobalAdjusterStage>("global_adjuster");
  ExpectSame(run.Finish());
}

// Without a loop the map keeps its two parts; both are adjusted when the last frame has its pose.
TEST(LoopPipeline, APolishedMapIsTheSameEachTimeAndTheLiveTrajectoryAsWithout) {
  const Overrides without_loops = {"mapper.close_loops=false"};
  const Overrides polished = {"mapper.close_loops=false", "mapper.polish=true"};
  LoopRun plain("1x1", 1, without_loops), first("1x1", 1, polished), second("2x2", 2, polished);
  const nlohmann::json plain_figures = plain.Finish(), figures = first.Finish();
  ASSERT_TRUE(second.Reach(kNumFrames));
  second.Restart<MapperStage>("mapper");
  second.Restart<GlobalAdjusterStage>("global_adjuster");
  const nlohmann::json again = second.Finish();
  ASSERT_FALSE(plain_figures.is_null() || figures.is_null() || again.is_null());
  EXPECT_EQ(first.num_usable_adjustments(), 1);
  EXPECT_EQ(plain.num_usable_adjustments(), 0);
  EXPECT_EQ(first.folder().Read("trajectory_live.txt"), plain.folder().Read("trajectory_live.txt"));
  for (const char* file : {"trajectory.txt", "keyframes.txt"}) {
    EXPECT_NE(first.folder().Read(file), plain.folder().Read(file)) << file;
  }
  EXPECT_EQ(figures["keyframes"], plain_figures["keyframes"]);
  for (const char* key : {"trajectory_sha256", "map_sha256"}) {
    EXPECT_NE(figures[key], plain_figures[key]) << key;
    EXPECT_EQ(again[key], figures[key]) << key;
  }
}

// The file of the reference run's map, to be loaded.
std::string LoadMap() {
  EXPECT_FALSE(Reference().is_null());
  return "mapper.load_map=" + ReferenceRun().folder().File("map.tessera");
}

TEST(LoopPipeline, ALoadedMapPlacesEveryFrameAndStaysAsItIs) {
  LoopRun run("1x1", 1, {LoadMap(), "tracker.localize_only=true"});
  const nlohmann::json figures = run.Finish();
  ASSERT_FALSE(figures.is_null());
  EXPECT_EQ(figures["frames_tracked"], kNumFrames);
  EXPECT_EQ(figures["map_sha256"], Reference()["map_sha256"]);
  EXPECT_TRUE(run.loops().empty());
  ExpectTruePlaces(run, kNumFrames);
}

TEST(LoopPipeline, ALoadedMapIsGoneOnWithTheSameWhateverDies) {
  LoopRun whole("1x1", 1, {LoadMap()});
  const nlohmann::json figures = whole.Finish();
  ASSERT_FALSE(figures.is_null());
  EXPECT_EQ(figures["frames_tracked"], kNumFrames) << "it knows all these places";
  ExpectTruePlaces(whole, kNumFrames);
  LoopRun run("2x2", 2, {LoadMap()});
  ASSERT_TRUE(run.Reach(50));
  run.Restart<MapperStage>("mapper");
  ASSERT_TRUE(run.Reach(80));
  run.Restart<LoopCloserStage>("loop_closer");
  const nlohmann::json again = run.Finish();
  ASSERT_FALSE(again.is_null());
  EXPECT_EQ(again["trajectory_sha256"], figures["trajectory_sha256"]);
  EXPECT_EQ(again["map_sha256"], figures["map_sha256"]);
}

}  // namespace
}  // namespace tessera
