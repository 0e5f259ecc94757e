// The whole pipeline, with a camera that plays a folder, in one process: whichever stage is killed, and
// whenever, the run ends with the same two hashes.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "messages/tracking_types.h"
#include "stages/camera/camera_stage.h"
#include "stages/dispatcher/dispatcher_stage.h"
#include "stages/evaluator/evaluator_stage.h"
#include "stages/extractor/extractor_stage.h"
#include "stages/mapper/mapper_stage.h"
#include "stages/reassembler/reassembler_stage.h"
#include "stages/tracker/tracker_stage.h"
#include "support/memory_bus.h"
#include "support/run_folder.h"
#include "support/synthetic_images.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNumFrames = 50;       // of most runs
constexpr int64_t kNumLongFrames = 220;  // of one that makes more keyframes than the mapper keeps deltas

void WriteImage(const std::string& path, const GrayImage& image) {
  std::ofstream file(path, std::ios::binary);
  file << "P5 " << image.width << " " << image.height << " 255\n";
  file.write(reinterpret_cast<const char*>(image.pixels.data()), static_cast<std::streamsize>(image.pixels.size()));
}

// The moving scene as a stereo sequence of KITTI, with the true poses.
class Sequence {
 public:
  Sequence() {
    for (const char* folder : {"/03", "/03/image_0", "/03/image_1"}) fs::create_directory(folder_.path() + folder);
    const MovingScene scene(kNumLongFrames);
    std::ofstream times(folder_.File("03/times.txt")), poses(folder_.File("03/poses.txt"));
    for (int64_t id = 0; id < kNumLongFrames; ++id) {
      const CameraFrame frame = scene.Frame(id);
      const std::string digits = std::to_string(id);
      const std::string name = std::string(6 - digits.size(), '0') + digits + ".pgm";
      WriteImage(folder_.File("03/image_0/" + name), frame.left);
      WriteImage(folder_.File("03/image_1/" + name), frame.right);
      times << 0.1 * static_cast<double>(id) << "\n";
      poses << "1 0 0 " << MovingScene::kStepM * static_cast<double>(id) << " 0 1 0 0 0 0 1 0\n";
    }
    std::ofstream(folder_.File("03/calib.txt"))
        << "P0: 300 0 160 0 0 300 120 0 0 0 1 0\n"
        << "P1: 300 0 160 " << -300 * MovingScene::kBaselineM << " 0 300 120 0 0 0 1 0\n";
  }
  std::string path() const { return folder_.File("03"); }

 private:
  RunFolder folder_;
};

Settings SettingsOf(const RunFolder& folder, int64_t num_frames, double keyframe_min_share,
                    const std::vector<std::string>& assignments) {
  static const Sequence sequence;
  Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
  settings.Override("camera.source=kitti:" + sequence.path());
  settings.Override("camera.sensor=stereo");
  settings.Override("dispatcher.tiles=2x2");
  settings.Override("features.num_features=400");
  settings.Override("camera.last_frame=" + std::to_string(num_frames));
  settings.Override("tracker.keyframe_min_share_with_depth=" + std::to_string(keyframe_min_share));
  settings.Override("tracker.relocalize=false");  // nobody is there to answer
  settings.Override("mapper.close_loops=false");
  settings.Override("evaluator.out_dir=" + folder.path());
  settings.Override("stream.journal_dir=" + folder.File("journal"));
  for (const std::string& assignment : assignments) settings.Override(assignment);
  return settings;
}

class StackRun {
 public:
  // A share of 0.9 makes many keyframes on a short way.
  explicit StackRun(int64_t num_frames = kNumFrames, double keyframe_min_share = 0.9,
                    const std::vector<std::string>& assignments = {})
      : bus_(SettingsOf(folder_, num_frames, keyframe_min_share, assignments)) {
    StageContext& probe = bus_.AddContext("probe");
    probe.Subscribe(kPose, [this](const PoseEstimate& pose) { last_pose_ = std::max(last_pose_, pose.frame); });
    probe.Subscribe(kMapSnapshot, [this](const MapSnapshotPage& page) { snapshot_ = page.part.number; });
    probe.Subscribe(kMapDelta, [this](const MapDelta&) { ++num_deltas_; });
    bus_.Start<EvaluatorStage>("evaluator");
    bus_.Start<MapperStage>("mapper");
    bus_.Start<TrackerStage>("tracker");
    bus_.Start<ReassemblerStage>("reassembler");
    bus_.Start<DispatcherStage>("dispatcher");
    for (int id = 0; id < 2; ++id) bus_.Start<ExtractorStage>("extractor_" + std::to_string(id), id);
    bus_.Start<CameraStage>("camera");
  }

  bool Reach(int64_t num_poses) {
    return bus_.RunUntil([&] { return last_pose_.value + 1 >= num_poses; });
  }
  // Empty if the run did not end.
  nlohmann::json Finish() {
    if (!bus_.RunUntil([&] { return fs::exists(folder_.File("run.json")); })) return {};
    return nlohmann::json::parse(folder_.Read("run.json"));
  }
  void Kill(const std::string& name) {
    bus_.Kill(name);
    fs::remove(folder_.File("run.json"));  // which SIGKILL would not have let the evaluator write
  }
  template <class Stage>
  void Restart(const std::string& name) {
    Kill(name);
    Wait();
    bus_.Start<Stage>(name);
  }
  // As long as a launcher takes to start a process again; what the dead one said last is heard meanwhile.
  void Wait() {
    bus_.RunUntil([] { return false; }, 0.2);
  }
  MemoryBus& bus() { return bus_; }
  // The last delta that a snapshot which was asked for holds; -1: there was none.
  int64_t snapshot() const { return snapshot_; }
  // That were sent, once or again.
  int64_t num_deltas() const { return num_deltas_; }

 private:
  RunFolder folder_;
  MemoryBus bus_;
  FrameId last_pose_;
  int64_t snapshot_ = -1;
  int64_t num_deltas_ = 0;
};

void ExpectSame(const nlohmann::json& figures) {
  static const nlohmann::json reference = StackRun().Finish();
  ASSERT_FALSE(reference.is_null());
  ASSERT_EQ(reference["frames_tracked"], kNumFrames);
  ASSERT_GT(reference["keyframes"], 4);
  ASSERT_FALSE(figures.is_null()) << "the run did not end";
  for (const char* key :
       {"frames", "frames_tracked", "frames_dropped", "keyframes", "landmarks", "trajectory_sha256", "map_sha256"}) {
    EXPECT_EQ(figures[key], reference[key]) << key;
  }
}

// At several times, once with messages that get lost.
template <class Stage>
void ExpectSameAfterDeathsOf(const std::string& name) {
  for (const int64_t num_poses : {0, 1, 18, 37, 49, 50}) {
    SCOPED_TRACE(name + " is killed after " + std::to_string(num_poses) + " poses");
    StackRun run;
    std::mt19937 generator(static_cast<unsigned>(num_poses));
    if (num_poses % 2 == 1) run.bus().LoseMessages([&](const std::string&) { return generator() % 20 == 0; });
    ASSERT_TRUE(run.Reach(num_poses));
    run.Restart<Stage>(name);
    ExpectSame(run.Finish());
  }
}

TEST(Revival, AReassemblerIsGivenWhatIsNotTracked) { ExpectSameAfterDeathsOf<ReassemblerStage>("reassembler"); }

TEST(Revival, ADispatcherGoesOnBehindWhatIsTracked) { ExpectSameAfterDeathsOf<DispatcherStage>("dispatcher"); }

TEST(Revival, ACameraGoesOnBehindWhatIsTracked) { ExpectSameAfterDeathsOf<CameraStage>("camera"); }

TEST(Revival, ATrackerContinuesByItsJournal) { ExpectSameAfterDeathsOf<TrackerStage>("tracker"); }

TEST(Revival, AMapperContinuesByItsJournal) { ExpectSameAfterDeathsOf<MapperStage>("mapper"); }

TEST(Revival, AnEvaluatorIsToldAllAgain) { ExpectSameAfterDeathsOf<EvaluatorStage>("evaluator"); }

// Without a journal. Poses are relative to keyframes that left the map before the snapshot that it begins with.
TEST(Revival, AnEvaluatorIsToldWhatLeftTheMapBeforeIt) {
  const nlohmann::json expected = StackRun(kNumLongFrames, 0.999).Finish();
  ASSERT_FALSE(expected.is_null());
  StackRun run(kNumLongFrames, 0.999, {"stream.journal_dir="});
  ASSERT_TRUE(run.Reach(kNumLongFrames - 5));
  run.Restart<EvaluatorStage>("evaluator");
  const nlohmann::json figures = run.Finish();
  ASSERT_FALSE(figures.is_null());
  EXPECT_GT(run.snapshot(), 40);
  EXPECT_LT(run.num_deltas() - run.snapshot(), 240) << "each that it asks for is sent again once or twice";
  for (const char* key : {"frames_tracked", "keyframes", "trajectory_sha256", "map_sha256"}) {
    EXPECT_EQ(figures[key], expected[key]) << key;
  }
}

TEST(Revival, AllStagesBeforeTheTrackerDieAtOnce) {
  StackRun run;
  ASSERT_TRUE(run.Reach(20));
  for (const char* name : {"camera", "dispatcher", "reassembler", "extractor_0"}) run.bus().Kill(name);
  run.Wait();
  run.bus().Start<ReassemblerStage>("reassembler");
  run.bus().Start<DispatcherStage>("dispatcher");
  run.bus().Start<ExtractorStage>("extractor_0", 0);
  run.bus().Start<CameraStage>("camera");
  ExpectSame(run.Finish());
}

// Nobody else keeps more than some frames: what is needed again is on the disk.
TEST(Revival, AllStagesBehindTheReassemblerDieAtOnceAndAgain) {
  StackRun run(kNumFrames, 0.9, {"stream.history_bytes=250000"});
  for (const int64_t num_poses : {15, 30, 45}) {
    ASSERT_TRUE(run.Reach(num_poses));
    for (const char* name : {"tracker", "mapper", "evaluator"}) run.Kill(name);
    run.Wait();
    run.bus().Start<EvaluatorStage>("evaluator");
    run.bus().Start<MapperStage>("mapper");
    run.bus().Start<TrackerStage>("tracker");
  }
  ExpectSame(run.Finish());
}

// Frames that an earlier reassembler sent are nowhere else.
TEST(Revival, TheReassemblerDiesAndThenTheTracker) {
  StackRun run;
  ASSERT_TRUE(run.Reach(15));
  run.Restart<ReassemblerStage>("reassembler");
  ASSERT_TRUE(run.Reach(30));
  run.Restart<TrackerStage>("tracker");
  ExpectSame(run.Finish());
}

TEST(Revival, ATrackerWhoseJournalWasGivenUpEndsWithASentence) {
  StackRun run(kNumFrames, 0.9, {"stream.journal_mb=1"});
  ASSERT_TRUE(run.Reach(40));
  run.bus().Kill("tracker");
  EXPECT_THROW(run.bus().Start<TrackerStage>("tracker"), std::runtime_error);
}

}  // namespace
}  // namespace tessera
