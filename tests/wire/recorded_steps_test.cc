// What a replay of a live run needs to know comes out of its log: the steps, and the relocalisations that were used.
#include "wire/recorded_steps.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/errors.h"
#include "messages/topics.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

class RecordedStepsTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  template <class Value>
  void Write(const std::string& channel, const Value& value, size_t max_bytes = 60000) {
    const MessageHeader header{.publisher = "tracker", .epoch_us = 1'700'000'000'000'000, .sequence = sequence_};
    for (const Bytes& message : EncodeValue(value, header, max_bytes)) {
      log_.Write(sequence_++, prefix_ + channel, message);
    }
  }
  void WritePose(int64_t frame, int64_t num_deltas, int64_t relocalized_by = -1) {
    Write("POSE",
          PoseEstimate{
              .frame = {frame}, .relocalized_by = {relocalized_by}, .num_deltas = num_deltas, .is_live = is_live_});
  }
  void WriteAnswer(int64_t frame, int64_t reference, int num_seen) {
    RelocalizationAnswer answer{.frame = {frame}, .reference = {reference}};
    for (int i = 0; i < num_seen; ++i) answer.seen.push_back({i, {10 * i}});
    Write("RELOCALIZATION", answer, 1380);
  }
  RecordedSteps Read() {
    log_.Close();
    return ReadRecordedSteps(path_, prefix_);
  }

  const std::string folder_ = testing::TempDir() + "recorded_steps_test";
  const std::string path_ = (std::filesystem::create_directories(folder_), folder_ + "/run.lcmlog");
  const std::string prefix_ = "robot/";
  LogFileWriter log_{path_};
  int64_t sequence_ = 0;
  bool is_live_ = true;
};

TEST_F(RecordedStepsTest, TellsWhetherFramesOfTheLogDidNotReachTheTracker) {
  WritePose(3, 0);
  Write("END_OF_STREAM", EndOfStream{.stage = StageKind::kCamera, .num_frames = 9, .num_dropped = 4});
  Write("END_OF_STREAM", EndOfStream{.stage = StageKind::kTracker, .num_frames = 9, .num_dropped = 5});
  EXPECT_TRUE(Read().has_drops);
}

TEST_F(RecordedStepsTest, ACameraThatDroppedFramesLeavesNoneOfThemInTheLog) {
  WritePose(3, 0);
  Write("END_OF_STREAM", EndOfStream{.stage = StageKind::kCamera, .num_frames = 9, .num_dropped = 4});
  EXPECT_FALSE(Read().has_drops);
}

TEST_F(RecordedStepsTest, KeepsTheStepOfEachFrameAndTheAnswersThatWereUsed) {
  WritePose(3, 0);
  WritePose(4, 2);
  WriteAnswer(4, -1, 0);    // no place was found
  WriteAnswer(5, 17, 500);  // in many parts
  WritePose(6, 2);
  WritePose(7, 5, 5);  // placed by what came late
  WriteAnswer(8, 18, 60);
  WritePose(8, 6, 8);
  WriteAnswer(9, 19, 60);  // came too late for anybody
  const RecordedSteps recorded = Read();
  EXPECT_TRUE(recorded.is_live);
  EXPECT_EQ(recorded.steps, (std::map<FrameId, int64_t>{{{3}, 0}, {{4}, 2}, {{6}, 2}, {{7}, 5}, {{8}, 6}}));
  EXPECT_EQ(recorded.relocalized_by, (std::map<FrameId, FrameId>{{{7}, {5}}, {{8}, {8}}}));
  ASSERT_EQ(recorded.relocalizations.size(), 2U);
  EXPECT_EQ(recorded.relocalizations.at({5}).reference, KeyframeId{17});
  EXPECT_EQ(recorded.relocalizations.at({5}).seen.size(), 500U);
  EXPECT_EQ(recorded.relocalizations.at({5}).seen.back(), (SeenLandmark{499, {4990}}));
  EXPECT_EQ(recorded.relocalizations.at({8}).reference, KeyframeId{18});
}

TEST_F(RecordedStepsTest, ARunInLogicalTimeIsNotLive) {
  is_live_ = false;
  WritePose(0, 0);
  WritePose(1, 1);
  const RecordedSteps recorded = Read();
  EXPECT_FALSE(recorded.is_live);
  EXPECT_EQ(recorded.steps.size(), 2U);
  EXPECT_TRUE(recorded.relocalizations.empty());
}

TEST_F(RecordedStepsTest, ADamagedAnswerIsTold) {
  WritePose(0, 0);
  Write("RELOCALIZATION", RelocalizationAnswer{.frame = {-1}});
  try {
    (void)Read();
    FAIL() << "the answer is for no frame";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("RELOCALIZATION"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace tessera
