// The recorder's log has every message of every stream once and in order, whatever the network loses.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "core/errors.h"
#include "stages/recorder/recorder_stage.h"
#include "support/example_values.h"
#include "support/memory_bus.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

class RecorderTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Settings MakeSettings(const std::string& prefix) const {
    Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
    settings.Override("recorder.path=" + path_);
    settings.Override("bus.channel_prefix=" + prefix);
    settings.Override("stream.journal_dir=" + folder_ + "/journal");
    return settings;
  }
  // Ends the recorder as SIGKILL would, which leaves its files as they are.
  void Kill(MemoryBus& bus) const {
    const std::string kept = folder_ + "/kept";
    for (const std::string& file : parts_) fs::copy_file(file, kept + fs::path(file).extension().string());
    bus.Kill("recorder");
    fs::remove(path_);
    fs::remove(path_ + ".checksums");
    for (const std::string& file : parts_) fs::rename(kept + fs::path(file).extension().string(), file);
  }
  // The numbers of the messages in the log, by channel, and the times in order.
  std::map<std::string, std::vector<int64_t>> ReadNumbers() const {
    std::map<std::string, std::vector<int64_t>> numbers;
    LogFileReader reader(path_);
    int64_t time_us = 0;
    for (LogEvent event; reader.Next(&event); time_us = event.time_us) {
      EXPECT_GE(event.time_us, time_us);
      const auto header = ReadHeader(event.data);
      numbers[event.channel].push_back(header ? header->sequence : -1);
    }
    return numbers;
  }
  static std::vector<int64_t> Counted(size_t count) {
    std::vector<int64_t> numbers(count);
    for (size_t i = 0; i < count; ++i) numbers[i] = static_cast<int64_t>(i);
    return numbers;
  }

  const std::string folder_ = testing::TempDir() + "recorder_test";
  const std::string path_ = folder_ + "/run.lcmlog";
  const std::vector<std::string> parts_{path_ + ".part", path_ + ".part.checksums"};  // until it has its name
};

TEST_F(RecorderTest, HasEveryMessageOnceInOrder) {
  MemoryBus bus(MakeSettings("robot/"));
  std::mt19937 generator(4);
  bus.LoseMessages([&](const std::string&) { return generator() % 6 == 0; });
  bus.Start<RecorderStage>("recorder");
  const auto frames = bus.AddContext("camera").Advertise(kCamera);
  const auto jobs = bus.AddContext("dispatcher").Advertise(TileTopic(3));
  for (int i = 0; i < 20; ++i) {
    frames.Publish(DrawValue<CameraFrame>(generator, 1));
    jobs.Publish(DrawValue<TileJob>(generator, 1));
  }
  bus.RunUntilQuiet(2.0);
  bus.Kill("recorder");  // its destructor closes the log
  const auto numbers = ReadNumbers();
  for (const std::string channel : {"robot/CAMERA", "robot/TILE_3"}) {
    ASSERT_TRUE(numbers.contains(channel));
    EXPECT_GE(numbers.at(channel).size(), 20U) << channel;
    EXPECT_EQ(numbers.at(channel), Counted(numbers.at(channel).size())) << channel;
  }
  EXPECT_TRUE(numbers.contains("robot/STATUS"));
  // Played again, these would speak of publishers that are gone.
  EXPECT_FALSE(numbers.contains("robot/HEARTBEAT"));
  EXPECT_FALSE(numbers.contains("robot/REPAIR"));
}

TEST_F(RecorderTest, HasWhatWasSentBeforeItCame) {
  MemoryBus bus(MakeSettings(""));
  const auto poses = bus.AddContext("tracker").Advertise(kPose);
  for (int i = 0; i < 10; ++i) poses.Publish({.frame = {i}});
  bus.RunUntilQuiet();
  bus.Start<RecorderStage>("recorder");
  bus.RunUntilQuiet();
  bus.Kill("recorder");
  EXPECT_EQ(ReadNumbers()["POSE"], Counted(10));
}

TEST_F(RecorderTest, OneThatIsKilledContinuesItsLogAndLosesNothing) {
  MemoryBus bus(MakeSettings("robot/"));
  std::mt19937 generator(4);
  bus.Start<RecorderStage>("recorder");
  const auto frames = bus.AddContext("camera").Advertise(kCamera);
  const auto poses = bus.AddContext("tracker").Advertise(kPose);
  const auto publish = [&](int64_t number) {
    for (int64_t i = 0; i < number; ++i) {
      frames.Publish(DrawValue<CameraFrame>(generator, 1));
      poses.Publish({.frame = {i}});
    }
  };
  publish(20);
  bus.RunUntilQuiet(2.0);
  for (const std::string torn : {"an event of which the half was wr", "\1\2"}) {
    Kill(bus);
    std::ofstream(torn.size() > 4 ? parts_[0] : parts_[1], std::ios::app) << torn;
    publish(7);
    bus.RunUntilQuiet();
    bus.Start<RecorderStage>("recorder");
    publish(5);
    bus.RunUntilQuiet(2.0);
  }
  bus.Kill("recorder");
  const auto numbers = ReadNumbers();  // checks the checksums
  EXPECT_GE(numbers.at("robot/CAMERA").size(), 44U);
  EXPECT_EQ(numbers.at("robot/CAMERA"), Counted(numbers.at("robot/CAMERA").size()));
  EXPECT_EQ(numbers.at("robot/POSE"), Counted(44));
  EXPECT_FALSE(fs::exists(parts_[0]) || fs::exists(parts_[1]));
}

TEST_F(RecorderTest, OneThatIsKilledAfterItHadGivenUpLeavesNoLogThatLooksWhole) {
  MemoryBus bus(MakeSettings(""));
  bus.Start<RecorderStage>("recorder");
  const auto poses = bus.AddContext("tracker").Advertise(kPose);
  bus.RunUntilQuiet();
  Kill(bus);
  for (const std::string& file : parts_) fs::remove(file);
  bus.Start<RecorderStage>("recorder");
  poses.Publish({.frame = {1}});
  bus.RunUntilQuiet();
  EXPECT_EQ(bus.exit_status("recorder"), 0) << "the run goes on";
  bus.Kill("recorder");
  EXPECT_FALSE(fs::exists(path_));
}

// Files of this process can't grow beyond a size, as on a full disk.
class SmallDisk {
 public:
  explicit SmallDisk(rlim_t max_file_bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{max_file_bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SmallDisk() { setrlimit(RLIMIT_FSIZE, &before_); }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  rlimit before_{};
};

TEST_F(RecorderTest, OnAFullDiskItGivesUpWithoutEndingTheRunAndItsLogIsNotTakenForAWholeOne) {
  const SmallDisk disk(100'000);
  MemoryBus bus(MakeSettings(""));
  std::mt19937 generator(4);
  bus.Start<RecorderStage>("recorder");
  const auto frames = bus.AddContext("camera").Advertise(kCamera);
  for (int i = 0; i < 100; ++i) frames.Publish(DrawValue<CameraFrame>(generator, 1));
  bus.RunUntilQuiet();
  EXPECT_EQ(bus.exit_status("recorder"), 0) << "the run goes on";
  bus.Kill("recorder");
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(RecorderTest, AnAbandonedLogKeepsItsBeginningAndGivesRoomBack) {
  LogFileWriter log(path_);
  for (int i = 0; i < 10; ++i) log.Write(i, "CHANNEL", Bytes(1000));
  log.Abandon(2000);
  EXPECT_FALSE(std::filesystem::exists(path_));
  LogFileReader reader(path_ + ".part");
  int num_events = 0;
  EXPECT_THROW(for (LogEvent event; reader.Next(&event);)++ num_events, InputError);
  EXPECT_EQ(num_events, 8);
}

TEST_F(RecorderTest, APathThatCantBeWrittenIsRefused) {
  Settings settings = MakeSettings("");
  settings.Override("recorder.path=" + folder_ + "/none/run.lcmlog");
  MemoryBus bus(settings);
  EXPECT_THROW(bus.Start<RecorderStage>("recorder"), InputError);
}

}  // namespace
}  // namespace tessera
