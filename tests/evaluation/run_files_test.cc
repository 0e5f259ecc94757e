#include "evaluation/run_files.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "core/errors.h"
#include "core/files.h"
#include "evaluation/pose_text.h"
#include "geometry/body_state.h"
#include "support/matchers.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

class RunFilesTest : public testing::Test {
 protected:
  std::string Read(const std::string& name) const { return temporary_.Read(name); }

  // Three frames: initializing, tracked and a keyframe, lost.
  static RunRecord SmallRun() {
    RunRecord record;
    for (int i = 0; i < 3; ++i) {
      PoseEstimate pose;
      pose.frame = FrameId{i};
      pose.utime_us = 1'403'636'584'763'555 + i;
      pose.captured_us = 1'000'000;
      pose.state = static_cast<TrackingState>(i);
      pose.world_from_camera.translation = {0.25 * i, -1.0, 2.0};
      pose.num_features = 2000;
      pose.num_matches = 50;
      pose.num_inliers = 40;
      pose.num_landmarks = 900;
      pose.is_keyframe = i == 1;
      pose.scale_sigma = i == 1 ? 0.25 : 0.0;
      if (i == 1) pose.map_part = KeyframeId{0};
      pose.num_deltas = i / 2;
      pose.map_wait_us = i / 2 * 6000;
      record.AddPose(pose, 1'010'000 + 4'000 * i);
      record.AddGroundTruth({pose.frame, pose.utime_us, {}});
    }
    auto features = std::make_shared<FeatureFrame>();
    features->frame = FrameId{1};
    features->utime_us = 1'403'636'584'763'556;
    features->keypoints.resize(1);
    features->descriptors.resize(1);
    MapDelta delta{.new_keyframes = {{{0}, {}, {}, features}},
                   .changed_landmarks = {{{4}, {.position_in_world = {1.5, -2.0, 30.0}, .normal = {0.0, 0.0, -1.0}}}},
                   .new_observations = {{{4}, {{0}, 0}}}};
    Map trial;
    (void)trial.Apply(delta);
    delta.hash = trial.hash();
    EXPECT_THAT(record.ApplyDelta(delta), IsSuccess());
    record.SetStage("tracker", {.step_ms = {3, 2.0, 1.5, 4.0, 5.0, 6.0}, .num_repaired = 2, .num_lost = 1});
    record.SetStage("extractor_0", {.num_repaired = 5});
    record.SetEnd(3, 0);
    return record;
  }

  const TemporaryFolder temporary_;
  const std::string& folder_ = temporary_.path();
};

TEST(PoseText, TumRowHasTheTimeToTheMicrosecond) {
  const Rigid3 pose{Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {1.0, -2.5, 1e-9}};
  EXPECT_EQ(TumRow(1'403'636'584'763'555, pose),
            "1403636584.763555 1.000000000 -2.500000000 0.000000001 -0.500000000 0.500000000 0.500000000 "
            "0.500000000\n");
  EXPECT_EQ(TumRow(3, {}).substr(0, 9), "0.000003 ");
  EXPECT_EQ(TumRow(-1'500'000, {}).substr(0, 10), "-1.500000 ");
}

TEST(PoseText, KittiRowIsTheMatrixRowByRow) {
  const Rigid3 pose{Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ())), {1.0, 2.0, 3.0}};
  double numbers[12];
  std::istringstream row(KittiRow(pose));
  for (double& number : numbers) {
    row >> number;
  }
  EXPECT_NEAR(numbers[0], -1.0, 1e-9);
  EXPECT_EQ(numbers[3], 1.0);
  EXPECT_NEAR(numbers[5], -1.0, 1e-9);
  EXPECT_EQ(numbers[7], 2.0);
  EXPECT_EQ(numbers[10], 1.0);
  EXPECT_EQ(numbers[11], 3.0);
}

TEST_F(RunFilesTest, WritesAllFilesAndLeavesNothingBeside) {
  const std::string folder = folder_ + "/new/run";
  WriteRun(SmallRun(), folder);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names,
            (std::vector<std::string>{"frames.csv", "ground_truth.txt", "keyframes.txt", "loops.csv", "map.ply",
                                      "run.json", "trajectory.txt", "trajectory_kitti.txt", "trajectory_live.txt"}));
}

TEST_F(RunFilesTest, TrajectoryHoldsTrackedFramesOnly) {
  WriteRun(SmallRun(), folder_);
  EXPECT_EQ(Read("trajectory.txt"),
            "# timestamp tx ty tz qx qy qz qw\n"
            "1403636584.763556 0.250000000 -1.000000000 2.000000000 0.000000000 0.000000000 0.000000000 "
            "1.000000000\n");
  EXPECT_EQ(Read("trajectory_live.txt"), Read("trajectory.txt"));
  const std::string kitti = Read("trajectory_kitti.txt"), truth = Read("ground_truth.txt");
  EXPECT_EQ(std::count(kitti.begin(), kitti.end(), '\n'), 3);
  EXPECT_EQ(std::count(truth.begin(), truth.end(), '\n'), 4);
}

TEST_F(RunFilesTest, PosesAreThoseOfTheBodyAndTheHashesStay) {
  WriteRun(SmallRun(), folder_);
  const std::string run = Read("run.json");
  WriteRun(SmallRun(), folder_, {ForwardLeftUpFromCamera().rotation, {0.3, 0.0, 0.12}});
  EXPECT_EQ(Read("run.json"), run);
  EXPECT_EQ(Read("trajectory.txt"),
            "# timestamp tx ty tz qx qy qz qw\n"
            "1403636584.763556 2.000000000 -0.250000000 1.000000000 0.000000000 0.000000000 0.000000000 "
            "1.000000000\n");
}

TEST_F(RunFilesTest, LandmarksHaveColorsInTheMapsFileWhereTheyAreKnown) {
  RunRecord record = SmallRun();
  WriteRun(record, folder_);
  EXPECT_EQ(Read("map.ply").find("red"), std::string::npos);
  record.AddColor({.id = {1},
                   .utime_us = 1'403'636'584'763'556,
                   .image = ColorImage(2, 2, {.red = 'r', .green = 'g', .blue = 'b'})});
  WriteRun(record, folder_);
  const std::string ply = Read("map.ply");
  EXPECT_NE(ply.find("property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"), std::string::npos);
  EXPECT_EQ(ply.substr(ply.size() - 7), std::string("\1\0\0\0rgb", 7)) << "one observer, and its color";
}

TEST_F(RunFilesTest, TrajectorySaysThatItsPartsAreNotJoined) {
  RunRecord record = SmallRun();
  ASSERT_EQ(record.Parts().size(), 1U);
  MapDelta delta{.number = record.map().next_delta(), .answers = {99}};
  delta.new_keyframes.push_back({{99}, {}, Rigid3{}, std::make_shared<FeatureFrame>()});
  Map after = record.map();
  (void)after.Apply(delta);
  delta.hash = after.hash();
  ASSERT_THAT(record.ApplyDelta(delta), IsSuccess());
  WriteRun(record, folder_);
  const std::string text = Read("trajectory.txt");
  EXPECT_EQ(text.rfind("# The map has 2 parts that no loop has joined", 0), 0U) << text;
  EXPECT_NE(text.find("\n# part 2: 0 frames, 1 keyframes\n# timestamp"), std::string::npos) << text;
  EXPECT_EQ(Read("trajectory_live.txt").rfind("# timestamp", 0), 0U);
}

TEST_F(RunFilesTest, FramesCsvHasARowPerFrame) {
  EXPECT_EQ(FramesCsv(SmallRun()),
            "frame,utime_us,state,pose_time_ms,latency_ms,map_wait_ms,features,matches,inliers,landmarks,is_keyframe,"
            "num_deltas,is_step_doubtful,scale_sigma,map_part\n"
            "0,1403636584763555,initializing,,10.000,0.000,2000,50,40,900,0,0,0,0.000,\n"
            "1,1403636584763556,tracked,4.000,14.000,0.000,2000,50,40,900,1,0,0,0.250,0\n"
            "2,1403636584763557,lost,4.000,18.000,6.000,2000,50,40,900,0,1,0,0.000,\n");
}

TEST_F(RunFilesTest, LoopsCsvHasARowPerLoop) {
  RunRecord record;
  EXPECT_EQ(LoopsCsv(record), "keyframe_timestamp_s,matched_timestamp_s,inliers,scale\n");
  MapDelta delta{.closed_loops = {{{1}, {0}, 1.25, 87}}};
  for (int64_t k = 0; k < 2; ++k) {
    auto features = std::make_shared<FeatureFrame>();
    features->utime_us = 1'403'636'584'763'555 + 90'000'000 * k;
    delta.new_keyframes.push_back({{k}, {k - 1}, {}, features});
  }
  Map trial;
  (void)trial.Apply(delta);
  delta.hash = trial.hash();
  ASSERT_THAT(record.ApplyDelta(delta), IsSuccess());
  EXPECT_EQ(LoopsCsv(record),
            "keyframe_timestamp_s,matched_timestamp_s,inliers,scale\n"
            "1403636674.763555,1403636584.763555,87,1.250000\n");
  EXPECT_EQ(nlohmann::json::parse(RunJson(record))["loops_closed"], 1);
}

TEST_F(RunFilesTest, RunJsonHoldsTheFigures) {
  const RunRecord record = SmallRun();
  const auto json = nlohmann::json::parse(RunJson(record));
  EXPECT_EQ(json["frames"], 3);
  EXPECT_EQ(json["frames_tracked"], 1);
  EXPECT_EQ(json["frames_lost"], 1);
  EXPECT_EQ(json["frames_initializing"], 1);
  EXPECT_EQ(json["frames_dropped"], 0);
  EXPECT_EQ(json["tracking_failures"], 1);
  EXPECT_EQ(json["keyframes"], 1);
  EXPECT_EQ(json["landmarks"], 1);
  EXPECT_EQ(json["map_parts"], 1);
  ASSERT_EQ(json["parts"].size(), 1U);
  EXPECT_EQ(json["parts"][0]["keyframes"], 1);
  EXPECT_EQ(json["parts"][0]["is_main"], true);
  EXPECT_TRUE(json["parts"][0]["first_frame"].is_null()) << "no frame was tracked relative to it";
  EXPECT_DOUBLE_EQ(json["map_wait_ms"]["mean"], 2.0);
  EXPECT_DOUBLE_EQ(json["pose_time_ms"]["median"], 4.0);
  EXPECT_DOUBLE_EQ(json["latency_ms"]["max"], 18.0);
  EXPECT_EQ(json["stage_ms"]["tracker"]["count"], 3);
  EXPECT_EQ(json["stage_ms"]["tracker"]["p95"], 4.0);
  EXPECT_FALSE(json["stage_ms"].contains("extractor_0"));  // it has no step yet
  EXPECT_EQ(json["messages_repaired"], 7);
  EXPECT_EQ(json["messages_lost"], 1);
  EXPECT_EQ(json["trajectory_sha256"], record.TrajectorySha256());
  EXPECT_EQ(json["map_sha256"], record.map().Sha256Hex());
}

TEST_F(RunFilesTest, TheMapIsACloudOfItsLandmarks) {
  WriteRun(SmallRun(), folder_);
  const std::string file = Read("map.ply");
  EXPECT_EQ(file.substr(0, 39), "ply\nformat binary_little_endian 1.0\ncom");
  EXPECT_NE(file.find("element vertex 1\n"), std::string::npos);
  std::array<float, 6> position_and_normal{};
  int32_t num_observations = 0;
  const std::string row = file.substr(file.find("end_header\n") + 11);
  ASSERT_EQ(row.size(), sizeof position_and_normal + sizeof num_observations);
  std::memcpy(position_and_normal.data(), row.data(), sizeof position_and_normal);
  std::memcpy(&num_observations, row.data() + sizeof position_and_normal, sizeof num_observations);
  EXPECT_EQ(position_and_normal, (std::array<float, 6>{1.5, -2, 30, 0, 0, -1}));
  EXPECT_EQ(num_observations, 1);
}

TEST_F(RunFilesTest, AnEmptyRunHasFilesToo) {
  WriteRun(RunRecord(), folder_);
  const auto json = nlohmann::json::parse(Read("run.json"));
  EXPECT_EQ(json["frames"], 0);
  EXPECT_TRUE(json["pose_time_ms"].is_null());
  EXPECT_EQ(json["map_parts"], 0);
  EXPECT_TRUE(json["parts"].empty());
}

TEST_F(RunFilesTest, AFileThatCantBeWrittenLeavesTheOthersAndIsTold) {
  fs::create_directories(folder_ + "/trajectory.txt/taken");
  fs::create_directories(folder_ + "/map.ply/taken");
  const auto fails = [](const std::string& path) { throw std::runtime_error("no room for " + path); };
  const auto works = [](const std::string& path) { WriteFile(path, "a map"); };
  const auto not_written =
      WriteRun(SmallRun(), folder_, {}, {{folder_ + "/map.tessera", fails}, {folder_ + "/copy.tessera", works}});
  ASSERT_EQ(not_written.size(), 3U);
  EXPECT_NE(not_written[0].find("trajectory.txt"), std::string::npos);
  EXPECT_EQ(not_written[1], "no room for " + folder_ + "/map.tessera");
  EXPECT_NE(not_written[2].find("map.ply"), std::string::npos);
  for (const char* name : {"trajectory_live.txt", "keyframes.txt", "frames.csv", "copy.tessera"}) {
    EXPECT_FALSE(Read(name).empty()) << name;
  }
  EXPECT_EQ(nlohmann::json::parse(Read("run.json"))["not_written"], nlohmann::json(not_written));
}

TEST_F(RunFilesTest, SmallAndPreciousFilesAreThereBeforeTheMaps) {
  std::string run_json;
  const auto look = [&](const std::string&) { run_json = Read("run.json"); };
  EXPECT_TRUE(WriteRun(SmallRun(), folder_, {}, {{folder_ + "/map.tessera", look}}).empty());
  EXPECT_EQ(run_json, Read("run.json"));
  EXPECT_TRUE(nlohmann::json::parse(run_json)["not_written"].empty());
}

TEST_F(RunFilesTest, ANameThatIsNoUtf8DoesNotKeepTheRunFromItsEnd) {
  RunRecord record = SmallRun();
  record.SetStage("tr\xff\xfe", {.step_ms = {3, 2.0, 1.5, 4.0, 5.0, 6.0}, .values = {{"\xc3", 1.0}}});
  EXPECT_TRUE(WriteRun(record, folder_).empty());
  const auto json = nlohmann::json::parse(Read("run.json"));
  EXPECT_TRUE(json["stage_ms"].contains("tr\uFFFD\uFFFD"));
}

TEST_F(RunFilesTest, AFolderThatCantBeMadeIsRefused) {
  WriteFile(folder_ + "/a.txt", "a file");
  EXPECT_THROW(WriteRun(SmallRun(), folder_ + "/a.txt"), InputError);
}

}  // namespace
}  // namespace tessera
