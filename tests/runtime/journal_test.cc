// What a stage received comes again to its successor, and what it says continues the streams that it began.
#include "runtime/journal.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "support/memory_bus.h"
#include "support/temporary_folder.h"

namespace tessera {
namespace {

constexpr int64_t kMaxBytes = 1'000'000;

Bytes MessageOf(int64_t i) { return Bytes(static_cast<size_t>(100 + i), static_cast<uint8_t>(i)); }

class JournalTest : public testing::Test {
 protected:
  JournalTest() : path_(folder_.path("journal/tracker.journal")) {}

  void Append(Journal& journal, int64_t first, int64_t end) {
    for (int64_t i = first; i < end; ++i) ASSERT_TRUE(journal.Append("POSE", MessageOf(i), 1000 + i));
  }
  // How many of MessageOf(0), (1), ... come again; -1 if anything else does.
  static int64_t Replay(Journal& journal) {
    int64_t num_entries = 0;
    while (const auto entry = journal.Next()) {
      const bool is_same = entry->channel == "POSE" && entry->arrival_us == 1000 + num_entries &&
                           entry->message == MessageOf(num_entries);
      if (!is_same) return -1;
      ++num_entries;
    }
    return num_entries;
  }

  TemporaryFolder folder_;
  const std::string path_;
};

TEST_F(JournalTest, EachLifeContinuesTheOneBefore) {
  for (int64_t life = 0; life < 3; ++life) {
    Journal journal(path_, 77 + life, kMaxBytes);
    EXPECT_EQ(journal.epoch_us(), 77);
    EXPECT_FALSE(journal.is_lost());
    EXPECT_EQ(journal.is_replaying(), life > 0);
    EXPECT_EQ(Replay(journal), 10 * life);
    EXPECT_FALSE(journal.is_replaying());
    Append(journal, 10 * life, 10 * life + 10);
  }
}

TEST_F(JournalTest, TellsHowMuchOfItHasBeenGiven) {
  {
    Journal journal(path_, 77, kMaxBytes);
    EXPECT_EQ(journal.replayed_share(), 1.0);
    Append(journal, 0, 50);
  }
  Journal journal(path_, 78, kMaxBytes);
  double last = journal.replayed_share();
  EXPECT_LT(last, 0.02);
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(journal.Next());
    EXPECT_GT(journal.replayed_share(), last);
    last = journal.replayed_share();
  }
  EXPECT_EQ(last, 1.0);
  EXPECT_FALSE(journal.Next());
  EXPECT_EQ(journal.replayed_share(), 1.0);
}

// A process dies, or a machine loses its power, wherever it is.
TEST_F(JournalTest, WhatIsNotWholeIsCutOff) {
  {
    Journal journal(path_, 77, kMaxBytes);
    Append(journal, 0, 3);
  }
  const std::string whole = folder_.Read("journal/tracker.journal");
  const size_t last = sizeof(uint64_t) + sizeof(int64_t) + 1 + 4 + MessageOf(2).size();
  const auto expect_two = [&](const std::string& bytes) {
    folder_.Write("journal/tracker.journal", bytes);
    Journal journal(path_, 78, kMaxBytes);
    EXPECT_EQ(Replay(journal), 2);
    Append(journal, 2, 5);
    Journal next(path_, 79, kMaxBytes);
    EXPECT_EQ(Replay(next), 5);
  };
  for (size_t num_cut = 1; num_cut < last; num_cut += 9) {
    SCOPED_TRACE(std::to_string(num_cut) + " bytes are cut off");
    expect_two(whole.substr(0, whole.size() - num_cut));
  }
  for (size_t i = whole.size() - last; i < whole.size(); i += 11) {
    SCOPED_TRACE("byte " + std::to_string(i) + " is another");
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x40);
    expect_two(damaged);
  }
  expect_two(whole.substr(0, whole.size() - last) + std::string(5000, '\0'));
}

TEST_F(JournalTest, AnEntryIsGivenByItsNameOrInItsTurn) {
  {
    Journal journal(path_, 77, kMaxBytes);
    EXPECT_FALSE(journal.NextOf("step")) << "nothing is replayed";
    for (const char* name : {"POSE", "step", "step", "POSE"}) ASSERT_TRUE(journal.Append(name, MessageOf(0), 1000));
  }
  // The last one is cut off, and its rest must not be taken for entries.
  const std::string whole = folder_.Read("journal/tracker.journal");
  folder_.Write("journal/tracker.journal", whole.substr(0, whole.size() - 20));
  Journal journal(path_, 78, kMaxBytes);
  EXPECT_FALSE(journal.NextOf("step")) << "another one comes before it";
  EXPECT_EQ(journal.Next()->channel, "POSE");
  EXPECT_EQ(journal.NextOf("step")->message, MessageOf(0));
  EXPECT_EQ(journal.Next()->channel, "step") << "nobody asked for it by its name";
  EXPECT_FALSE(journal.NextOf("step"));
  EXPECT_TRUE(journal.is_replaying());
  EXPECT_FALSE(journal.Next());
  EXPECT_FALSE(journal.is_replaying());
  ASSERT_TRUE(journal.Append("POSE", MessageOf(1), 1001));
  Journal next(path_, 79, kMaxBytes);
  std::vector<std::string> names;
  while (const auto entry = next.Next()) names.push_back(entry->channel);
  EXPECT_EQ(names, (std::vector<std::string>{"POSE", "step", "step", "POSE"}));
}

TEST_F(JournalTest, OneThatGrowsTooLargeIsGivenUpAndGivesItsRoomBack) {
  {
    Journal journal(path_, 77, 1000);
    Append(journal, 0, 5);
    const Result<> refused = journal.Append("POSE", MessageOf(700), 0);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().sentence.find("stream.journal_mb"), std::string::npos);
    EXPECT_TRUE(journal.Append("POSE", MessageOf(6), 0)) << "told once";
  }
  EXPECT_LT(folder_.Read("journal/tracker.journal").size(), 100U);
  Journal journal(path_, 78, kMaxBytes);
  EXPECT_TRUE(journal.is_lost());
  EXPECT_FALSE(journal.is_replaying());
}

TEST_F(JournalTest, AnEmptyOneWasGivenUpOnAFullDisk) {
  folder_.Write("journal/tracker.journal", "");
  EXPECT_TRUE(Journal(path_, 78, kMaxBytes).is_lost());
}

// As files are of a disk that has become read-only since they were begun; here of the kernel, which nobody can write.
TEST_F(JournalTest, OneThatCantBeWrittenAnyMoreIsGivenUp) {
  const std::string unwritable = "/sys/devices/system/cpu/online";
  if (!std::filesystem::exists(unwritable)) GTEST_SKIP() << "no sysfs";
  Journal journal(unwritable, 78, kMaxBytes);
  EXPECT_TRUE(journal.is_lost());
  EXPECT_FALSE(journal.is_replaying());
  EXPECT_TRUE(journal.Append("POSE", MessageOf(0), 0));
}

TEST_F(JournalTest, AFolderThatCantBeMadeIsAUserError) {
  folder_.Write("file", "");
  EXPECT_THROW(Journal(folder_.path("file/tracker.journal"), 77, kMaxBytes), InputError);
}

// Says for each pose how many came so far, and each time a timer tells it to, a question, which follows from nothing.
// To count is a long step, of which the result is remembered.
class Counter {
 public:
  explicit Counter(StageContext& context)
      : context_(context.KeepJournal({kPose}, {kLoopResult})),
        results_(context.Advertise(kLoopResult)),
        questions_(context.Advertise(kMapRequest)) {
    context.Subscribe(kPose, [this](const PoseEstimate& pose) {
      const std::optional<MapRequest> remembered = context_.Remembered<MapRequest>();
      if (!remembered) ++num_steps_;
      num_poses_ = remembered ? remembered->next_delta : num_poses_ + 1;
      if (!remembered) context_.Remember(MapRequest{.next_delta = num_poses_});
      results_.Publish({.answers = {pose.frame.value}, .num_candidates = static_cast<int32_t>(num_poses_)});
      questions_.Publish({.next_delta = num_poses_});
    });
    context.Every(std::chrono::milliseconds(10), [this] { questions_.Publish({.next_delta = num_poses_}); });
  }
  int64_t num_poses() const { return num_poses_; }
  int64_t num_steps() const { return num_steps_; }

 private:
  StageContext& context_;
  int64_t num_poses_ = 0;
  int64_t num_steps_ = 0;
  Publisher<LoopResult> results_;
  Publisher<MapRequest> questions_;
};

class ContinuedStreams : public testing::Test {
 protected:
  ContinuedStreams() : bus_(WithJournals()), poses_(bus_.AddContext("source").Advertise(kPose)) {
    StageContext& listener = bus_.AddContext("listener");
    listener.Subscribe(kLoopResult, [this](const LoopResult& result, const MessageInfo& info) {
      results_.emplace_back(result.answers.value, result.num_candidates);
      epochs_.insert(info.epoch_us);
    });
    listener.Subscribe(kMapRequest, [this](const MapRequest& request) { questions_.push_back(request.next_delta); });
  }

  Settings WithJournals() const {
    Settings settings = Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml");
    settings.Override("stream.journal_dir=" + folder_.path());
    return settings;
  }
  void PublishPoses(int64_t first, int64_t end) {
    for (int64_t frame = first; frame < end; ++frame) {
      PoseEstimate pose;
      pose.frame = {frame};
      poses_.Publish(pose);
    }
  }
  void Wait() {
    bus_.RunUntil([] { return false; }, 0.3);
  }
  void Kill() {
    bus_.Kill("counter");
    Wait();
  }
  bool RunUntilResults(size_t count) {
    return bus_.RunUntil([&] { return results_.size() >= count; });
  }
  void ExpectResults(int64_t count) const {
    std::vector<std::pair<int64_t, int64_t>> expected;
    for (int64_t i = 0; i < count; ++i) expected.emplace_back(i, i + 1);
    EXPECT_EQ(results_, expected);
    EXPECT_EQ(epochs_.size(), 1U) << "one stream";
  }

  TemporaryFolder folder_;
  MemoryBus bus_;
  Publisher<PoseEstimate> poses_;
  std::vector<std::pair<int64_t, int64_t>> results_;
  std::set<int64_t> epochs_;
  std::vector<int64_t> questions_;
};

TEST_F(ContinuedStreams, NobodyNoticesThatAStageWasKilled) {
  bus_.Start<Counter>("counter");
  for (int64_t num_poses = 10; num_poses <= 40; num_poses += 10) {
    PublishPoses(num_poses - 10, num_poses);
    ASSERT_TRUE(RunUntilResults(static_cast<size_t>(num_poses)));
    Kill();
    bus_.Start<Counter>("counter");
  }
  PublishPoses(40, 45);
  ASSERT_TRUE(RunUntilResults(45));
  ExpectResults(45);
}

// Killed before anybody heard what follows from what it received; and what came while it was away.
TEST_F(ContinuedStreams, WhatWasNotHeardIsAskedForAgain) {
  bus_.Start<Counter>("counter");
  PublishPoses(0, 10);
  ASSERT_TRUE(RunUntilResults(10));
  bus_.LoseMessages([](const std::string& channel) { return channel == "LOOP_RESULT"; });
  PublishPoses(10, 15);
  bus_.RunUntil([] { return false; }, 0.05);
  EXPECT_EQ(results_.size(), 10U);
  Kill();
  bus_.LoseMessages(nullptr);
  PublishPoses(15, 20);
  bus_.Start<Counter>("counter");
  ASSERT_TRUE(RunUntilResults(20));
  ExpectResults(20);
}

// Timers rest, and what they would say is not said again.
TEST_F(ContinuedStreams, WhatDoesNotFollowFromTheJournalIsNotRepeated) {
  bus_.Start<Counter>("counter");
  PublishPoses(0, 10);
  ASSERT_TRUE(RunUntilResults(10));
  Wait();
  Kill();
  questions_.clear();
  const Counter& counter = bus_.Start<Counter>("counter");
  Wait();
  EXPECT_EQ(counter.num_poses(), 10);
  ASSERT_FALSE(questions_.empty());
  for (const int64_t number : questions_) EXPECT_EQ(number, 10);
}

TEST_F(ContinuedStreams, WhatIsRememberedOfLongStepsIsNotDoneAgain) {
  for (int64_t num_poses = 10; num_poses <= 30; num_poses += 10) {
    const Counter& counter = bus_.Start<Counter>("counter");
    Wait();
    EXPECT_EQ(counter.num_poses(), num_poses - 10);
    EXPECT_EQ(counter.num_steps(), 0);
    PublishPoses(num_poses - 10, num_poses);
    ASSERT_TRUE(RunUntilResults(static_cast<size_t>(num_poses)));
    EXPECT_EQ(counter.num_steps(), 10);
    Kill();
  }
  ExpectResults(30);
}

TEST_F(ContinuedStreams, WithoutAFolderThereIsNoJournal) {
  bus_.Start<Counter>("counter", 0, {"stream.journal_dir="});
  PublishPoses(0, 5);
  ASSERT_TRUE(RunUntilResults(5));
  Kill();
  bus_.Start<Counter>("counter", 0, {"stream.journal_dir="});
  ASSERT_TRUE(RunUntilResults(10)) << "all is said again, in a new stream";
  EXPECT_EQ(epochs_.size(), 2U);
}

}  // namespace
}  // namespace tessera
