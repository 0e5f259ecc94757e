// Logs: written by a bus, read back; cut, damaged, mixed up, or not logs at all.
#include "wire/log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "core/errors.h"
#include "runtime/file_bus.h"
#include "support/example_values.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

constexpr int kNumFrames = 5;

struct Event {
  int64_t time_us = 0;
  std::string channel;
  Bytes data;
};

class LogTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("tessera_log_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  template <class Value>
  void Add(const Channel& channel, const Value& value, const std::string& publisher = "camera") {
    MessageHeader header{.publisher = publisher, .epoch_us = 1000, .sequence = next_[publisher + channel.name]};
    for (Bytes& message : EncodeValue(value, header, 30000)) {
      events_.push_back({time_us_, channel.name, std::move(message)});
      ++next_[publisher + channel.name];
    }
  }
  // What a camera sends that begins with this frame of its source.
  void AddRecording(int first_frame = 0) {
    std::mt19937 generator(1);
    calibration_ = DrawValue<CameraCalibration>(generator, 1);
    Add(kCalibration, calibration_);
    for (int i = 0; i < kNumFrames; ++i) {
      CameraFrame frame = DrawValue<CameraFrame>(generator, 1);
      frame.id = {first_frame + i};
      frame.utime_us = time_us_ = 50'000 * i;
      GroundTruthPose truth = DrawValue<GroundTruthPose>(generator, 1);
      truth.frame = frame.id;
      Add(kGroundTruth, truth);
      Add(kCamera, frame);
      frames_.push_back(frame);
    }
    const EndOfStream end{.num_frames = first_frame + kNumFrames, .num_values = first_frame};
    Add(kEndOfStream, end);
    Add(kEndOfStream, EndOfStream{.stage = StageKind::kDispatcher, .num_frames = end.num_frames}, "dispatcher");
  }
  std::string Write(Checksums checksums = Checksums::kNone) {
    LogFileWriter writer(Path("log"), checksums);
    for (const Event& event : events_) writer.Write(event.time_us, event.channel, event.data);
    writer.Close();
    return Path("log");
  }
  void ExpectWhole(const std::string& path) {
    LogReader reader(path);
    EXPECT_EQ(reader.num_frames(), kNumFrames);
    std::vector<CameraFrame> frames;
    int num_truths = 0;
    int num_calibrations = 0;
    std::vector<EndOfStream> ends;
    while (const auto value = reader.Next()) {
      if (const auto* frame = std::get_if<CameraFrame>(&*value)) frames.push_back(*frame);
      if (const auto* end = std::get_if<EndOfStream>(&*value)) ends.push_back(*end);
      if (const auto* calibration = std::get_if<CameraCalibration>(&*value)) {
        EXPECT_EQ(*calibration, calibration_);
        EXPECT_TRUE(frames.empty());
        ++num_calibrations;
      }
      num_truths += std::holds_alternative<GroundTruthPose>(*value) ? 1 : 0;
    }
    EXPECT_EQ(frames, frames_);
    EXPECT_EQ(num_truths, kNumFrames);
    EXPECT_EQ(num_calibrations, 1);
    ASSERT_EQ(ends.size(), 1U);
    EXPECT_EQ(ends[0].stage, StageKind::kCamera);
  }
  // The sentence with which the log is refused; empty if it is not.
  static std::string Refusal(const std::string& path) {
    try {
      LogReader reader(path);
      while (reader.Next()) continue;
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
  std::vector<Event> events_;
  std::map<std::string, int64_t> next_;
  int64_t time_us_ = 0;
  CameraCalibration calibration_;
  std::vector<CameraFrame> frames_;
};

TEST_F(LogTest, GivesBackWhatWasWritten) {
  AddRecording();
  ExpectWhole(Write());
}

TEST_F(LogTest, FindsTheColorsOfFramesWhereverTheyStand) {
  AddRecording();
  std::mt19937 generator(2);
  std::vector<ColorFrame> colors;
  for (const int64_t frame : {0, 2}) {
    colors.push_back(DrawValue<ColorFrame>(generator, 1));
    colors.back().id = {frame};
    Add(kColor, colors.back());
  }
  const std::string path = Write();
  ExpectWhole(path);
  LogReader reader(path);
  ASSERT_TRUE(reader.has_colors());
  EXPECT_EQ(reader.ColorOf({0}), colors[0].image);
  EXPECT_TRUE(reader.ColorOf({1}).empty());
  EXPECT_EQ(reader.ColorOf({2}), colors[1].image);
  EXPECT_TRUE(reader.ColorOf({3}).empty());
}

TEST_F(LogTest, PutsRightWhatWasRecordedTwiceOrOutOfOrder) {
  AddRecording();
  std::mt19937 generator(2);
  for (size_t i = 0; i + 1 < events_.size(); ++i) {
    if (generator() % 4 == 0) std::swap(events_[i], events_[i + 1]);
  }
  const size_t num_events = events_.size();
  for (size_t i = 0; i < num_events; i += 3) events_.push_back(events_[i]);
  LogReader reader(Write());
  std::vector<CameraFrame> frames;
  while (const auto value = reader.Next()) {
    if (const auto* frame = std::get_if<CameraFrame>(&*value)) frames.push_back(*frame);
  }
  EXPECT_EQ(frames, frames_);
}

TEST_F(LogTest, WithoutAnEndItIsWholeAllTheSame) {
  AddRecording();
  events_.resize(events_.size() - 2);
  EXPECT_EQ(Refusal(Write()), "");
}

TEST_F(LogTest, CutAnywhereIsRefusedWithItsName) {
  AddRecording();
  const std::string path = Write();
  const auto size = std::filesystem::file_size(path);
  std::mt19937 generator(3);
  for (int i = 0; i < 30; ++i) {
    std::filesystem::copy_file(path, Path("cut"), std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(Path("cut"), generator() % (size - 400));
    EXPECT_NE(Refusal(Path("cut")).find(Path("cut")), std::string::npos);
  }
}

TEST_F(LogTest, OfTheMiddleOfASourceLacksNothing) {
  AddRecording(1000);
  const std::string path = Write();
  EXPECT_EQ(LogReader(path).loss(), "");
  ExpectWhole(path);
}

TEST_F(LogTest, LackingMessagesItIsUsedAsFarAsItGoes) {
  AddRecording();
  const auto camera = [](const Event& event) { return event.channel == "CAMERA"; };
  const auto lost = std::find_if(events_.begin() + 12, events_.end(), camera);
  events_.erase(lost);
  LogReader reader(Write());
  EXPECT_EQ(reader.num_frames(), kNumFrames - 1);
  EXPECT_NE(reader.loss().find("4 of 5 frames are whole"), std::string::npos) << reader.loss();
  std::vector<FrameId> ids;
  while (const auto value = reader.Next()) {
    if (const auto* frame = std::get_if<CameraFrame>(&*value)) {
      ids.push_back(frame->id);
      EXPECT_EQ(*frame, frames_[static_cast<size_t>(frame->id.value)]);
    }
  }
  EXPECT_EQ(ids.size(), kNumFrames - 1U);
}

TEST_F(LogTest, WithoutAnEndTheFramesInBetweenAreMissed) {
  AddRecording();
  std::erase_if(events_, [](const Event& event) { return event.channel == "END_OF_STREAM"; });
  std::erase_if(events_, [](const Event& event) { return event.channel == "CAMERA" && event.time_us == 100'000; });
  LogReader reader(Write());
  EXPECT_NE(reader.loss().find("4 of 5 frames are whole"), std::string::npos) << reader.loss();
}

TEST_F(LogTest, AWholeOneLacksNothing) {
  AddRecording();
  EXPECT_EQ(LogReader(Write()).loss(), "");
}

TEST_F(LogTest, WithoutAnyWholeFrameItIsRefused) {
  AddRecording();
  std::erase_if(events_,
                [](const Event& event) { return event.channel == "CAMERA" && ReadHeader(event.data)->part == 0; });
  EXPECT_NE(Refusal(Write()).find("no whole frame"), std::string::npos);
}

TEST_F(LogTest, WithChecksumsEveryFlippedBitIsFound) {
  AddRecording();
  const std::string path = Write(Checksums::kBeside);
  EXPECT_EQ(Refusal(path), "");
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  const auto size = std::filesystem::file_size(path);
  std::mt19937 generator(5);
  for (int i = 0; i < 200; ++i) {
    const auto position = static_cast<std::streamoff>(generator() % size);
    const auto flip = [&] {
      file.seekg(position);
      const auto byte = static_cast<char>(file.get() ^ (1 << (i % 8)));
      file.seekp(position);
      file.put(byte).flush();
    };
    flip();
    EXPECT_NE(Refusal(path), "") << "byte " << position;
    flip();
  }
  EXPECT_EQ(Refusal(path), "");
}

TEST_F(LogTest, WithChecksumsACutBetweenTwoEventsIsFound) {
  AddRecording();
  const std::string path = Write(Checksums::kBeside);
  LogFileReader reader(path);
  LogEvent event;
  for (size_t i = 0; i + 1 < events_.size(); ++i) reader.Next(&event);
  std::filesystem::resize_file(path, static_cast<uintmax_t>(reader.position()));
  EXPECT_NE(Refusal(path).find("cut off"), std::string::npos);
}

TEST_F(LogTest, ANewLogHasNotTheChecksumsOfAnOldOne) {
  AddRecording();
  Write(Checksums::kBeside);
  events_.pop_back();
  EXPECT_EQ(Refusal(Write()), "");
  std::ofstream(Path("log.checksums")) << "no checksums";
  EXPECT_NE(Refusal(Path("log")).find("log.checksums is damaged"), std::string::npos);
}

TEST_F(LogTest, WhatIsNoLogIsRefused) {
  EXPECT_NE(Refusal(Path("nothing")).find("does not exist"), std::string::npos);
  EXPECT_NE(Refusal(folder_.string()).find("not a file"), std::string::npos);
  std::ofstream(Path("text")) << "This is a text.\n";
  EXPECT_NE(Refusal(Path("text")).find("not an LCM log"), std::string::npos);
  std::ofstream(Path("empty")) << "";
  EXPECT_NE(Refusal(Path("empty")).find("not an LCM log"), std::string::npos);
  Add(kEndOfStream, EndOfStream{.stage = StageKind::kCamera});
  EXPECT_NE(Refusal(Write()).find("CAMERA"), std::string::npos);
}

TEST_F(LogTest, DamagedBytesNeverCrash) {
  AddRecording();
  const std::string path = Write();
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  std::mt19937 generator(4);
  for (int i = 0; i < 200; ++i) {
    std::string damaged = bytes;
    for (int k = 0; k < 3; ++k) damaged[generator() % damaged.size()] = static_cast<char>(generator());
    std::ofstream(Path("damaged"), std::ios::binary) << damaged;
    (void)Refusal(Path("damaged"));
  }
}

TEST_F(LogTest, TwoRecordingsInOneAreRefused) {
  AddRecording();
  Add(kCamera, frames_[0], "other_camera");
  EXPECT_NE(Refusal(Write()).find("2 recordings"), std::string::npos);
}

TEST_F(LogTest, HasNoNameUntilItIsWhole) {
  {
    LogFileWriter writer(Path("log"));
    writer.Write(1, "CAMERA", Bytes(10));
    EXPECT_FALSE(std::filesystem::exists(Path("log")));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  EXPECT_THROW(LogFileWriter(Path("no_such_folder/log")), InputError);
}

}  // namespace
}  // namespace tessera
