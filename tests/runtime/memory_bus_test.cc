// The engine of stages on a bus in memory: values, losses, latecomers, failures.
#include "support/memory_bus.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/errors.h"
#include "core/version.h"
#include "runtime/stream_settings.h"
#include "support/example_values.h"

namespace tessera {
namespace {

Settings Defaults() { return Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml"); }

// The channel of each type does not matter here.
struct SendAndReceive {
  template <class Value>
  void operator()() const {
    if constexpr (!std::is_same_v<Value, Heartbeat> && !std::is_same_v<Value, RepairRequest>) {
      SCOPED_TRACE(TypeName<Value>());
      MemoryBus bus(Defaults());
      std::vector<Value> received;
      MessageInfo info;
      const Topic<Value> topic{"POSE"};
      bus.AddContext("listener").Subscribe(topic, [&](const Value& value, const MessageInfo& value_info) {
        received.push_back(value);
        info = value_info;
      });
      StageContext& sender = bus.AddContext("sender");
      const auto publisher = sender.Advertise(topic);
      std::mt19937 generator(9);
      std::vector<Value> sent;
      for (int i = 0; i < 5; ++i) {
        sent.push_back(DrawValue<Value>(generator, 1));
        publisher.Publish(sent.back());
      }
      ASSERT_TRUE(bus.RunUntil([&] { return received.size() == sent.size(); }, 1.0));
      for (size_t i = 0; i < sent.size(); ++i) EXPECT_TRUE(AreSame(sent[i], received[i]));
      EXPECT_EQ(info.publisher, "sender");
      EXPECT_EQ(info.epoch_us, sender.epoch_us());
      EXPECT_GE(info.arrival_us, info.publish_us);
    }
  }
};

TEST(MemoryBus, EveryTypeArrives) { ForEachSentType(SendAndReceive()); }

// A camera that sends frames, and a listener that counts them.
class Pair {
 public:
  explicit Pair(MemoryBus& bus, Topic<CameraFrame> topic = kCamera) : bus_(bus), topic_(std::move(topic)) {}

  void StartListener() {
    bus_.AddContext("listener").Subscribe(topic_, [this](const CameraFrame& frame) {
      received.push_back(frame.id.value);
    });
    bus_.AddContext("watcher").Subscribe(kStatus, [this](const StageStatus& new_status) {
      if (new_status.name == "listener") status = new_status;
    });
  }
  void StartCamera() { frames_ = bus_.AddContext("camera").Advertise(topic_); }
  void Send(int num_frames) {
    for (int i = 0; i < num_frames; ++i) {
      CameraFrame frame{.id = {num_sent_++}, .left = GrayImage(500, 400)};
      frames_.Publish(frame);
    }
  }
  void ExpectReceived(int64_t first, int64_t last) const {
    ASSERT_EQ(received.size(), static_cast<size_t>(last - first + 1));
    for (size_t i = 0; i < received.size(); ++i) EXPECT_EQ(received[i], first + static_cast<int64_t>(i));
  }

  std::vector<int64_t> received;
  StageStatus status;

 private:
  MemoryBus& bus_;
  const Topic<CameraFrame> topic_;
  Publisher<CameraFrame> frames_;
  int64_t num_sent_ = 0;
};

TEST(MemoryBus, LossesAreRepairedAndCounted) {
  MemoryBus bus(Defaults());
  std::mt19937 generator(1);
  bus.LoseMessages([&](const std::string& channel) { return channel != "STATUS" && generator() % 5 == 0; });
  Pair pair(bus);
  pair.StartListener();
  pair.StartCamera();
  pair.Send(100);
  ASSERT_TRUE(bus.RunUntil([&] { return pair.received.size() == 100; }));
  pair.ExpectReceived(0, 99);
  bus.RunUntilQuiet();
  EXPECT_GT(pair.status.num_repaired, 20);
  EXPECT_EQ(pair.status.num_lost, 0);
  EXPECT_EQ(pair.status.num_received, 100);
}

TEST(MemoryBus, WhileManyMessagesGetLostEachHasOnePacket) {
  Settings settings = Defaults();
  settings.Override("bus.max_message_bytes=1400");
  settings.Override("bus.max_work_message_bytes=8872");
  MemoryBus bus(std::move(settings));
  bool loses = false;
  std::mt19937 generator(4);
  bus.LoseMessages(
      [&](const std::string& channel) { return loses && channel == "TILE_FEATURES" && generator() % 5 == 0; });
  size_t largest = 0;
  bus.bus().Subscribe(&largest, "TILE_FEATURES", [&](const std::string&, ByteView message, int64_t) {
    largest = std::max(largest, message.size());
  });
  Pair pair(bus, {{.name = "TILE_FEATURES", .bus = BusKind::kWork}});
  pair.StartListener();
  pair.StartCamera();
  size_t num_sent = 0;
  const auto largest_of = [&](int num_frames) {
    largest = 0;
    pair.Send(num_frames);
    num_sent += static_cast<size_t>(num_frames);
    EXPECT_TRUE(bus.RunUntil([&] { return pair.received.size() == num_sent; }));
    return largest;
  };
  EXPECT_GT(largest_of(5), 8000u);
  EXPECT_LE(largest, 8872u);
  loses = true;
  largest_of(5);
  EXPECT_LE(largest_of(5), 1400u);
  loses = false;
  EXPECT_LE(largest_of(5), 1400u) << "not at once";
  bus.RunUntil([] { return false; }, 15.0);
  EXPECT_GT(largest_of(5), 8000u);
}

// How many heartbeats of the camera are heard within a second.
class HeartbeatCount {
 public:
  explicit HeartbeatCount(MemoryBus& bus) : bus_(bus) {
    bus.AddContext("counter").Subscribe(kHeartbeat, [this](const Heartbeat&, const MessageInfo& info) {
      count_ += info.publisher == "camera" ? 1 : 0;
    });
  }
  int64_t NextSecond() {
    const int64_t before = count_;
    bus_.RunUntil([] { return false; }, 1.0);
    return count_ - before;
  }

 private:
  MemoryBus& bus_;
  int64_t count_ = 0;
};

TEST(MemoryBus, HeartbeatsAreRareOfWhoHasNothingToSay) {
  MemoryBus bus(Defaults());
  Pair pair(bus);
  pair.StartCamera();
  HeartbeatCount heartbeats(bus);
  EXPECT_GE(heartbeats.NextSecond(), 9) << "it has just begun";
  heartbeats.NextSecond();
  EXPECT_LE(heartbeats.NextSecond(), 3);
  pair.Send(1);
  EXPECT_GE(heartbeats.NextSecond(), 9) << "the message may have been lost";
  heartbeats.NextSecond();
  EXPECT_LE(heartbeats.NextSecond(), 3);
}

TEST(MemoryBus, AnIdleProcessAnswersANewOneAtOnce) {
  MemoryBus bus(Defaults());
  Pair pair(bus);
  pair.StartCamera();
  pair.Send(5);
  bus.RunUntil([] { return false; }, 5.0);
  pair.StartListener();
  EXPECT_TRUE(bus.RunUntil([&] { return pair.received.size() == 5; }, 0.1));
}

// What was sent is repaired also where most heartbeats are lost.
TEST(MemoryBus, ALostTailOfAnIdleProcessIsRepaired) {
  MemoryBus bus(Defaults());
  Pair pair(bus);
  pair.StartListener();
  pair.StartCamera();
  bus.RunUntil([] { return false; }, 5.0);
  bool is_lossy = true;
  bus.LoseMessages([&](const std::string& channel) { return is_lossy && channel != "STATUS"; });
  pair.Send(3);
  bus.RunUntil([] { return false; }, 2.0);
  EXPECT_TRUE(pair.received.empty());
  is_lossy = false;
  EXPECT_TRUE(bus.RunUntil([&] { return pair.received.size() == 3; }, 0.6));
  EXPECT_EQ(pair.status.num_lost, 0);
}

TEST(MemoryBus, WhoComesLateGetsWhatIsKept) {
  MemoryBus bus(Defaults());
  Pair pair(bus);
  pair.StartCamera();
  pair.Send(30);
  bus.RunUntilQuiet();
  pair.StartListener();
  ASSERT_TRUE(bus.RunUntil([&] { return pair.received.size() == 30; }));
  pair.ExpectReceived(0, 29);
}

// 20 frames are lost of which the camera keeps five.
void LoseForGood(MemoryBus& bus, Pair& pair) {
  bool loses = false;
  bus.LoseMessages([&](const std::string& channel) { return loses && channel == "CAMERA"; });
  pair.StartListener();
  pair.StartCamera();
  pair.Send(2);
  bus.RunUntilQuiet();
  loses = true;
  pair.Send(20);
  loses = false;
  pair.Send(1);
  ASSERT_TRUE(bus.RunUntil([&] { return !pair.received.empty() && pair.received.back() == 22; }));
  bus.RunUntilQuiet();
  bus.LoseMessages(nullptr);
  EXPECT_LT(pair.received.size(), 10U);
}

Settings KeepingFiveFrames() {
  Settings settings = Defaults();
  settings.Override("stream.history_bytes=1000000");
  return settings;
}

TEST(MemoryBus, WhatNobodyKeepsIsCountedAsLost) {
  MemoryBus bus(KeepingFiveFrames());
  Pair pair(bus);
  LoseForGood(bus, pair);
  EXPECT_GE(pair.status.num_lost, 16 * 4);
  EXPECT_NE(pair.status.last_error.find("CAMERA"), std::string::npos);
}

TEST(MemoryBus, WhatIsMadeUpForCountsAsRepaired) {
  MemoryBus bus(KeepingFiveFrames());
  Topic<CameraFrame> topic = kCamera;
  topic.unrepaired = Unrepaired::kRequested;
  Pair pair(bus, topic);
  LoseForGood(bus, pair);
  EXPECT_EQ(pair.status.num_lost, 0);
  EXPECT_GE(pair.status.num_repaired, 16 * 4);
  EXPECT_EQ(pair.status.last_error, "");
}

TEST(MemoryBus, ARestartedPublisherIsHeard) {
  MemoryBus bus(Defaults());
  Pair pair(bus);
  pair.StartListener();
  pair.StartCamera();
  pair.Send(3);
  bus.RunUntilQuiet();
  bus.Kill("camera");
  bus.RunUntilQuiet(2.0);
  pair.StartCamera();
  pair.Send(3);
  ASSERT_TRUE(bus.RunUntil([&] { return pair.received.size() == 6; }));
}

TEST(MemoryBus, ASecondPublisherEndsWithASentence) {
  MemoryBus bus(Defaults());
  bus.AddContext("tracker").Advertise(kPose);
  bus.AddContext("other_tracker").Advertise(kPose);
  ASSERT_TRUE(bus.RunUntil([&] { return bus.exit_status("other_tracker") != 0; }));
  EXPECT_EQ(bus.exit_status("other_tracker"), 1);
  EXPECT_NE(bus.failure("other_tracker").find("POSE already has a publisher: tracker"), std::string::npos);
  EXPECT_EQ(bus.exit_status("tracker"), 0);
  // One that starts while the other is known already is refused at once.
  EXPECT_THROW(
      {
        StageContext& third = bus.AddContext("third_tracker");
        bus.RunUntilQuiet();
        third.Advertise(kPose);
      },
      std::runtime_error);
}

TEST(MemoryBus, ASecondProcessOfTheSameNameEnds) {
  MemoryBus bus(Defaults());
  bus.AddContext("extractor_0");
  StageContext& second = bus.AddContext("extractor_0", 0);
  int num_sent_after_failing = 0;
  bus.RunUntilQuiet();
  bus.AddContext("watcher").Subscribe(kExtractorReady, [&](const ExtractorReady&) { ++num_sent_after_failing; });
  second.Advertise(kExtractorReady).Publish({.extractor = 0});
  bus.RunUntilQuiet();
  EXPECT_EQ(num_sent_after_failing, 0);
}

TEST(MemoryBus, SeveralPublishersMayShareAChannelThatAllowsIt) {
  MemoryBus bus(Defaults());
  bus.AddContext("extractor_0").Advertise(kTileFeatures);
  bus.AddContext("extractor_1").Advertise(kTileFeatures);
  bus.RunUntilQuiet();
  EXPECT_EQ(bus.exit_status("extractor_0") + bus.exit_status("extractor_1"), 0);
}

TEST(JoinRobot, EachPrefixHasStreamsOfItsOwn) {
  MemoryBus bus(Defaults());
  std::mt19937 generator(3);
  bus.LoseMessages([&](const std::string&) { return generator() % 4 == 0; });
  StageContext& process = bus.AddContext("dispatcher");
  const auto own = process.Advertise(kEndOfStream);
  const auto of_a = process.JoinRobot("a_").Advertise(kEndOfStream);
  std::map<std::string, std::vector<int64_t>> heard;
  std::set<std::string> statuses;
  for (const std::string prefix : {"", "a_", "b_"}) {
    StageContext& listener = bus.AddContext(prefix + "listener", 0, {"bus.channel_prefix=" + prefix});
    listener.Subscribe(kEndOfStream,
                       [&heard, prefix](const EndOfStream& end) { heard[prefix].push_back(end.num_frames); });
    listener.Subscribe(kStatus, [&statuses, prefix](const StageStatus& status) {
      if (status.name == "dispatcher") statuses.insert(prefix);
    });
  }
  for (int64_t i = 0; i < 20; ++i) {
    own.Publish({.stage = StageKind::kDispatcher, .num_frames = i});
    of_a.Publish({.stage = StageKind::kDispatcher, .num_frames = 100 + i});
  }
  ASSERT_TRUE(bus.RunUntil([&] { return heard[""].size() >= 20 && heard["a_"].size() >= 20 && statuses.size() >= 2; }));
  bus.RunUntilQuiet();
  for (int64_t i = 0; i < 20; ++i) {
    EXPECT_EQ(heard[""].at(static_cast<size_t>(i)), i);
    EXPECT_EQ(heard["a_"].at(static_cast<size_t>(i)), 100 + i);
  }
  EXPECT_TRUE(heard["b_"].empty());
  EXPECT_EQ(statuses, (std::set<std::string>{"", "a_"}));
}

TEST(JoinRobot, ANamesakeUnderOnePrefixSilencesOnlyThat) {
  MemoryBus bus(Defaults());
  bus.AddContext("extractor_0", 0, {"bus.channel_prefix=a_"});
  bus.RunUntilQuiet();
  StageContext& pool = bus.AddContext("extractor_0");
  StageContext& under_a = pool.JoinRobot("a_");
  StageContext& under_b = pool.JoinRobot("b_");
  std::string last_error;
  bus.AddContext("watcher").Subscribe(kStatus, [&](const StageStatus& status) { last_error = status.last_error; });
  ASSERT_TRUE(bus.RunUntil([&] { return !last_error.empty(); }));
  EXPECT_NE(last_error.find("`a_`"), std::string::npos) << last_error;
  EXPECT_NE(last_error.find("another process has this name already"), std::string::npos) << last_error;
  EXPECT_TRUE(under_a.fell_silent());
  EXPECT_FALSE(under_b.fell_silent());
  EXPECT_FALSE(pool.fell_silent());
}

// A stage that counts the ends it hears, and its last status.
class CountingStage {
 public:
  explicit CountingStage(MemoryBus& bus) : bus_(bus) {
    bus.AddContext("watcher").Subscribe(kStatus, [this](const StageStatus& heard) {
      if (heard.name == "stage") status = heard;
    });
  }
  void SendEnds(int num) {
    const auto ends = bus_.AddContext("camera").Advertise(kEndOfStream);
    for (int i = 0; i < num; ++i) ends.Publish({.stage = StageKind::kCamera, .num_frames = i});
  }

  StageContext& context() { return context_; }
  int num_handled = 0;
  StageStatus status;

 private:
  MemoryBus& bus_;
  StageContext& context_ = bus_.AddContext("stage");
};

TEST(MemoryBus, AValueThatIsRefusedIsCountedReportedAndPassedOver) {
  MemoryBus bus(Defaults());
  CountingStage stage(bus);
  stage.context().Subscribe(kEndOfStream, [&](const EndOfStream& end) -> Result<> {
    ++stage.num_handled;
    return Require(end.num_frames != 1, "it has one frame");
  });
  stage.SendEnds(3);
  ASSERT_TRUE(bus.RunUntil([&] { return stage.num_handled == 3 && stage.status.num_received == 2; }));
  EXPECT_EQ(stage.status.num_undecodable, 1);
  EXPECT_NE(stage.status.last_error.find("it has one frame"), std::string::npos) << stage.status.last_error;
  EXPECT_EQ(bus.exit_status("stage"), 0);
}

TEST(MemoryBus, AHandlerThatThrowsEndsTheProcess) {
  MemoryBus bus(Defaults());
  CountingStage stage(bus);
  stage.context().Subscribe(kEndOfStream, [&](const EndOfStream&) {
    ++stage.num_handled;
    throw std::runtime_error("no idea what to do");
  });
  stage.SendEnds(3);
  ASSERT_TRUE(bus.RunUntil([&] { return stage.status.state == StageState::kFailed; }));
  EXPECT_EQ(stage.num_handled, 1) << "what came behind is not handled by a stage that may be half changed";
  EXPECT_EQ(bus.exit_status("stage"), 1);
  EXPECT_NE(bus.failure("stage").find("no idea what to do"), std::string::npos);
  EXPECT_EQ(stage.status.last_error, bus.failure("stage"));
}

TEST(MemoryBus, TimersAndIdleTasksThatThrowEndTheProcess) {
  MemoryBus bus(Defaults());
  bus.AddContext("timer").Every(std::chrono::milliseconds(10), [] { throw std::runtime_error("late"); });
  bus.AddContext("worker").WhenIdle([]() -> bool { throw InputError("the disk is full"); });
  bus.RunUntilQuiet();
  EXPECT_EQ(bus.exit_status("timer"), 1);
  EXPECT_EQ(bus.exit_status("worker"), 2);
  EXPECT_EQ(bus.failure("worker"), "the disk is full");
}

TEST(JoinRobot, AHandlerThatThrowsEndsTheWholeProcess) {
  MemoryBus bus(Defaults());
  StageContext& pool = bus.AddContext("extractor_0");
  pool.JoinRobot("a_").Subscribe(kEndOfStream, [](const EndOfStream&) { throw std::runtime_error("no idea"); });
  const auto ends = bus.AddContext("dispatcher", 0, {"bus.channel_prefix=a_"}).Advertise(kEndOfStream);
  ends.Publish({.stage = StageKind::kDispatcher});
  ASSERT_TRUE(bus.RunUntil([&] { return bus.exit_status("extractor_0") == 1; }));
}

TEST(MemoryBus, MessagesOfAnotherTypeAreCounted) {
  MemoryBus bus(Defaults());
  bus.AddContext("stage").Subscribe(Topic<EndOfStream>{"POSE"}, [](const EndOfStream&) { FAIL(); });
  int64_t num_undecodable = 0;
  bus.AddContext("watcher").Subscribe(kStatus, [&](const StageStatus& status) {
    if (status.name == "stage") num_undecodable = status.num_undecodable;
  });
  bus.AddContext("tracker").Advertise(kPose).Publish({.frame = {0}});
  ASSERT_TRUE(bus.RunUntil([&] { return num_undecodable == 1; }));
}

TEST(MemoryBus, TimersAndIdleTasksRunByTheBusesClock) {
  MemoryBus bus(Defaults());
  StageContext& stage = bus.AddContext("stage");
  int num_ticks = 0;
  int num_idle = 0;
  stage.Every(std::chrono::milliseconds(100), [&] { ++num_ticks; });
  int64_t burst_us = 0;
  stage.WhenIdle([&] {
    if (num_idle % 5 == 0) burst_us = stage.now_us();
    EXPECT_EQ(stage.now_us(), burst_us);  // as long as it returns true, no time passes
    return ++num_idle % 5 != 0;
  });
  const int64_t begin_us = stage.now_us();
  ASSERT_TRUE(bus.RunUntil([&] { return num_ticks == 51; }));
  EXPECT_NEAR(static_cast<double>(stage.now_us() - begin_us), 5e6, 1e5);
  EXPECT_GE(num_idle, 5 * 50);
}

TEST(MemoryBus, AnIdleTaskIsWokenWhenItAskedFor) {
  MemoryBus bus(Defaults());
  StageContext& stage = bus.AddContext("stage");
  const int64_t begin_us = stage.now_us();
  int num_woken = 0;
  stage.WhenIdle([&] {
    const int64_t due_us = begin_us + 12'345 * (num_woken + 1);
    if (stage.now_us() < due_us) {
      stage.WakeAt(due_us);
      return false;
    }
    EXPECT_EQ(stage.now_us(), due_us);
    ++num_woken;
    return true;
  });
  EXPECT_TRUE(bus.RunUntil([&] { return num_woken == 20; }));
}

TEST(MemoryBus, StatusTellsOfTheStage) {
  MemoryBus bus(Defaults());
  StageContext& stage = bus.AddContext("stage");
  StageStatus status;
  bus.AddContext("watcher").Subscribe(kStatus, [&](const StageStatus& new_status) {
    if (new_status.name == "stage") status = new_status;
  });
  for (int i = 1; i <= 100; ++i) stage.RecordStep(i);
  stage.SetQueue(4);
  stage.AddDropped(2);
  stage.SetValue("landmarks", 17);
  stage.SetValue("landmarks", 18);
  stage.Finish();
  EXPECT_TRUE(stage.finished());
  ASSERT_TRUE(bus.RunUntil([&] { return status.state == StageState::kFinished; }, 1.0));
  EXPECT_EQ(status.step.count, 100);
  EXPECT_NEAR(status.step.mean_ms, 50.5, 1e-9);
  EXPECT_NEAR(status.step.median_ms, 50.0, 1.0);
  EXPECT_NEAR(status.step.p95_ms, 95.0, 1.0);
  EXPECT_EQ(status.step.max_ms, 100.0);
  EXPECT_EQ(status.version, kVersion);
  EXPECT_EQ(status.queue, 4);
  EXPECT_EQ(status.num_dropped, 2);
  ASSERT_EQ(status.values.size(), 1U);
  EXPECT_EQ(status.values[0].second, 18.0);
  EXPECT_GT(status.rss_mb, 1.0);
}

TEST(MemoryBus, SameRunTwiceIsTheSame) {
  const auto run = [] {
    MemoryBus bus(Defaults());
    std::mt19937 generator(3);
    bus.LoseMessages([&](const std::string&) { return generator() % 7 == 0; });
    Pair pair(bus);
    pair.StartListener();
    pair.StartCamera();
    pair.Send(40);
    bus.RunUntilQuiet();
    return std::pair(pair.status.num_repaired, bus.AddContext("late").now_us());
  };
  EXPECT_EQ(run(), run());
}

TEST(StreamSettings, ABusMayHaveLargerMessagesThanAnother) {
  Settings given = Defaults();
  given.Override("bus.max_message_bytes=1400");
  given.Override("bus.max_work_message_bytes=8872");
  given.Override("bus.max_local_message_bytes=50000");
  const StreamSettings settings = StreamSettings::From(given);
  EXPECT_EQ(settings.MaxMessageBytes(BusKind::kMain), 1400u);
  for (const BusKind bus : {BusKind::kWork, BusKind::kTile}) EXPECT_EQ(settings.MaxMessageBytes(bus), 8872u);
  for (const BusKind bus : {BusKind::kCamera, BusKind::kColor, BusKind::kMap})
    EXPECT_EQ(settings.MaxMessageBytes(bus), 50000u);
  EXPECT_LT(settings.ReceiverOf(BusKind::kMap).max_asked, settings.ReceiverOf(BusKind::kWork).max_asked);
}

TEST(StreamSettings, AreChecked) {
  for (const char* assignment :
       {"bus.max_message_bytes=100", "bus.max_message_bytes=70000", "bus.max_work_message_bytes=0",
        "bus.max_local_message_bytes=70000", "stream.history_bytes=0", "stream.heartbeat_ms=0", "stream.repair_ms=0",
        "bus.first_tile_port=65300", "bus.channel_prefix=a b"}) {
    Settings settings = Defaults();
    EXPECT_THROW(settings.Override(assignment), InputError) << assignment;
  }
}

}  // namespace
}  // namespace tessera
