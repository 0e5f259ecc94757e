// Only members of a run speak: what anybody else sends is counted and passed over.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <map>
#include <string>
#include <vector>

#include "core/errors.h"
#include "runtime/run_dir.h"
#include "support/memory_bus.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

Settings Defaults() { return Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml"); }

const std::string kSecret(64, '7');

void MakeRunDir(const TemporaryFolder& folder, const std::string& name, const std::string& secret) {
  folder.Write(name + "/secret", secret + "\n");
  chmod(folder.path(name + "/secret").c_str(), 0600);
}

// A listener that is a member, and everything that it believed.
class Members : public testing::Test {
 protected:
  Members() : bus_(RunSettings()), listener_(bus_.AddContext("listener")) {
    bus_.AddContext("watcher").Subscribe(kStatus, [this](const StageStatus& status) {
      if (status.name == "listener") status_ = status;
    });
    listener_.Subscribe(kPose, [this](const PoseEstimate& pose) { poses_.push_back(pose.frame.value); });
    listener_.Subscribe(kExtractorReady,
                        [this](const ExtractorReady& ready) { ready_.push_back(ready.num_jobs_done); });
    listener_.Subscribe(kEndOfStream, [this](const EndOfStream& end) { ends_.push_back(end.stage); });
    // Two heartbeats, so that streams have begun.
    bus_.RunUntilQuiet();
  }

  Settings RunSettings() {
    MakeRunDir(folder_, "run", kSecret);
    Settings settings = Defaults();
    settings.Override("bus.run_dir=" + folder_.path("run"));
    return settings;
  }
  // Everything on a channel, as it is sent.
  std::vector<Bytes>& Capture(const std::string& channel) {
    bus_.bus().Subscribe(this, channel, [this](const std::string&, ByteView message, int64_t) {
      captured_.emplace_back(message.begin(), message.end());
    });
    return captured_;
  }

  TemporaryFolder folder_;
  MemoryBus bus_;
  StageContext& listener_;
  std::vector<int64_t> poses_, ready_;
  std::vector<StageKind> ends_;
  StageStatus status_;
  std::vector<Bytes> captured_;
};

TEST_F(Members, BelieveEachOther) {
  const auto poses = bus_.AddContext("tracker").Advertise(kPose);
  for (int i = 0; i < 5; ++i) poses.Publish({.frame = {i}});
  bus_.RunUntilQuiet();
  EXPECT_EQ(poses_, (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(status_.num_strangers, 0);
}

TEST_F(Members, RepairWhatIsLostWithItsTag) {
  const auto poses = bus_.AddContext("tracker").Advertise(kPose);
  int num_sent = 0;
  bus_.LoseMessages([&](const std::string& channel) { return channel == "POSE" && num_sent++ % 2 == 0; });
  for (int i = 0; i < 20; ++i) poses.Publish({.frame = {i}});
  bus_.RunUntilQuiet(3.0);
  EXPECT_EQ(poses_.size(), 20U);
  EXPECT_GT(status_.num_repaired, 0);
  EXPECT_EQ(status_.num_strangers, 0);
}

// A listener that was started again on a busy machine hears the sixth message first, and no heartbeat for a while: it
// took the stream to begin there.
TEST_F(Members, AreWaitedForWhereTheirHeartbeatsAreLate) {
  const auto poses = bus_.AddContext("tracker").Advertise(kPose);
  int num_poses = 0, num_heartbeats = 0;
  bus_.LoseMessages([&](const std::string& channel) {
    return (channel == "POSE" && num_poses++ < 5) || (channel == "HEARTBEAT" && num_heartbeats++ < 30);
  });
  for (int i = 0; i < 8; ++i) poses.Publish({.frame = {i}});
  bus_.RunUntilQuiet(3.0);
  EXPECT_EQ(poses_, (std::vector<int64_t>{0, 1, 2, 3, 4, 5, 6, 7}));
}

TEST_F(Members, PassOverWhoHasNoSecretOrAnother) {
  MakeRunDir(folder_, "other", std::string(64, '8'));
  const auto unsigned_poses = bus_.AddContext("tracker", 0, {"bus.run_dir="}).Advertise(kPose);
  const auto foreign_poses =
      bus_.AddContext("foreign_tracker", 0, {"bus.run_dir=" + folder_.path("other")}).Advertise(kPose);
  for (int i = 0; i < 5; ++i) {
    unsigned_poses.Publish({.frame = {i}});
    foreign_poses.Publish({.frame = {i}});
  }
  bus_.RunUntilQuiet();
  EXPECT_TRUE(poses_.empty());
  EXPECT_GE(status_.num_strangers, 10) << "and their heartbeats";
  EXPECT_EQ(status_.num_undecodable, 0);
  EXPECT_EQ(bus_.exit_status("listener"), 0);
}

TEST_F(Members, AreNotEndedByAStrangerOfTheSameName) {
  bus_.AddContext("tracker").Advertise(kPose);
  bus_.RunUntilQuiet();
  bus_.AddContext("tracker", 0, {"bus.run_dir="}).Advertise(kPose);
  bus_.RunUntilQuiet();
  EXPECT_EQ(bus_.failure("tracker"), "");
}

TEST_F(Members, HearEachMessageOnce) {
  std::vector<Bytes>& captured = Capture("EXTRACTOR_READY");
  const auto ready = bus_.AddContext("extractor_0").Advertise(kExtractorReady);
  for (int i = 0; i < 3; ++i) {
    ready.Publish({.num_jobs_done = i});
    bus_.RunUntilQuiet();
  }
  for (const Bytes& message : std::vector<Bytes>(captured)) {
    bus_.bus().Publish("EXTRACTOR_READY", message, std::nullopt);  // captured, and sent again
  }
  bus_.RunUntilQuiet();
  EXPECT_EQ(ready_, (std::vector<int64_t>{0, 1, 2}));
  EXPECT_EQ(status_.num_strangers, 3);
}

TEST_F(Members, BelieveACameraOutsideOfTheRunOnlyWhatCamerasSay) {
  StageContext& open = bus_.AddContext("open", 0, {"bus.camera_is_member=false"});
  std::vector<StageKind> ends;
  int num_frames = 0;
  int num_poses = 0;
  open.Subscribe(kEndOfStream, [&](const EndOfStream& end) { ends.push_back(end.stage); });
  open.Subscribe(kCamera, [&](const CameraFrame&) { ++num_frames; });
  open.Subscribe(kPose, [&](const PoseEstimate&) { ++num_poses; });
  StageContext& player = bus_.AddContext("camera", 0, {"bus.run_dir="});
  player.Advertise(kCamera).Publish({.id = {0}, .left = GrayImage(50, 40)});
  player.Advertise(kPose).Publish({.frame = {0}});
  const auto player_ends = player.Advertise(kEndOfStream);
  for (const StageKind stage : {StageKind::kTracker, StageKind::kCamera}) player_ends.Publish({.stage = stage});
  bus_.AddContext("tracker").Advertise(kEndOfStream).Publish({.stage = StageKind::kTracker});
  ASSERT_TRUE(bus_.RunUntil([&] { return num_frames == 1 && ends.size() == 2; }, 5.0));
  bus_.RunUntilQuiet();
  EXPECT_EQ(num_poses, 0);
  EXPECT_EQ(ends.size(), 2U) << "the camera's own, and that of the tracker who is a member";
  EXPECT_EQ(ends_, std::vector{StageKind::kTracker}) << "who expects no camera outside believes none";
}

TEST_F(Members, OfAnotherPrefixAreStrangers) {
  std::vector<Bytes>& captured = Capture("a_POSE");
  bus_.AddContext("tracker", 0, {"bus.channel_prefix=a_"}).Advertise(kPose).Publish({.frame = {1}});
  bus_.RunUntilQuiet();
  ASSERT_EQ(captured.size(), 1U);
  bus_.bus().Publish("POSE", Bytes(captured.front()), std::nullopt);
  bus_.RunUntilQuiet();
  EXPECT_TRUE(poses_.empty());
}

TEST_F(Members, RecordMembersOnly) {
  std::map<std::string, int> num_recorded;
  StageContext& recorder = bus_.AddContext("recorder");
  recorder.SubscribeAll([&](const std::string& channel, ByteView, int64_t) { ++num_recorded[channel]; });
  bus_.AddContext("tracker").Advertise(kPose).Publish({.frame = {1}});
  StageContext& stranger = bus_.AddContext("stranger", 0, {"bus.run_dir="});
  stranger.Advertise(kKeyframe).Publish({});
  stranger.Advertise(kExtractorReady).Publish({});
  bus_.bus().Publish("OTHERS", Bytes{1, 2, 3}, std::nullopt);
  bus_.RunUntilQuiet();
  EXPECT_EQ(num_recorded["POSE"], 1);
  EXPECT_EQ(num_recorded["KEYFRAME"], 0);
  EXPECT_EQ(num_recorded["EXTRACTOR_READY"], 0);
  EXPECT_EQ(num_recorded["OTHERS"], 1) << "what is not this project's is nobody's to judge";
}

TEST_F(Members, CanNotFloodTheBusByAskingForRepairs) {
  StageContext& sender = bus_.AddContext("camera");
  const auto frames = sender.Advertise(kCamera);
  for (int i = 0; i < 100; ++i) frames.Publish({.id = {i}, .left = GrayImage(600, 400)});  // 24 MB
  bus_.RunUntilQuiet();
  int64_t num_bytes = 0;
  bus_.bus().Subscribe(this, "CAMERA", [&](const std::string&, ByteView message, int64_t) {
    num_bytes += static_cast<int64_t>(message.size());
  });
  const auto requests = listener_.Advertise(kRepair);
  const int64_t begin_us = listener_.now_us();
  for (int i = 0; i < 100; ++i) {
    requests.Publish(
        {.channel = "CAMERA", .publisher = "camera", .epoch_us = sender.epoch_us(), .ranges = {{0, 10'000}}});
    bus_.RunUntilQuiet(0.001);
  }
  const double seconds = 1e-6 * static_cast<double>(listener_.now_us() - begin_us);
  EXPECT_GT(num_bytes, 1'000'000);
  EXPECT_LT(static_cast<double>(num_bytes), 64e6 * seconds + 2.2e6) << "in " << seconds << " s";
}

TEST(RunDir, ASecretThatOthersCanReadIsNone) {
  const TemporaryFolder folder;
  MakeRunDir(folder, "run", kSecret);
  EXPECT_EQ(ReadRunSecret(folder.path("run"))[31], 0x77);
  chmod(folder.path("run/secret").c_str(), 0640);
  EXPECT_THROW(ReadRunSecret(folder.path("run")), InputError);
}

TEST(RunDir, ASecretIsWholeOrRefused) {
  const TemporaryFolder folder;
  EXPECT_THROW(ReadRunSecret(folder.path("none")), InputError);
  for (const std::string& text : {std::string(), std::string(63, '7'), std::string(65, '7'), std::string(64, 'x')}) {
    MakeRunDir(folder, "run", text);
    EXPECT_THROW(ReadRunSecret(folder.path("run")), InputError) << text;
  }
}

TEST(RunDir, EpochsGrowAlsoWhenTheClockIsSetBack) {
  const TemporaryFolder folder;
  const int64_t day_us = 86'400'000'000;
  EXPECT_EQ(BeginEpoch(folder.path(), "mapper", 10 * day_us), 10 * day_us);
  EXPECT_EQ(BeginEpoch(folder.path(), "mapper", day_us), 10 * day_us + 1) << "a board without a clock of its own";
  EXPECT_EQ(BeginEpoch(folder.path(), "mapper", day_us), 10 * day_us + 2);
  EXPECT_EQ(BeginEpoch(folder.path(), "mapper", 11 * day_us), 11 * day_us);
  EXPECT_EQ(BeginEpoch(folder.path(), "tracker", day_us), day_us) << "each name for itself";
}

TEST(RunDir, AnEpochIsFoundAlsoWhereNothingCanBeKept) {
  const TemporaryFolder folder;
  EXPECT_EQ(BeginEpoch("", "mapper", 5), 5);
  EXPECT_EQ(BeginEpoch(folder.path("none"), "mapper", 5), 5);
  folder.Write("epoch-mapper", "99999999999999999999");
  EXPECT_EQ(BeginEpoch(folder.path(), "mapper", 5), 5) << "a damaged file";
}

}  // namespace
}  // namespace tessera
