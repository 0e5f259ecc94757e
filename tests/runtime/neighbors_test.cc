// Of two processes with one name, or two publishers of one channel, the younger has to end.
#include "runtime/neighbors.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kOwnEpochUs = 1000;

StageIdentity Own() { return {.name = "tracker", .epoch_us = kOwnEpochUs, .host = "here", .pid = 7}; }

Heartbeat HeartbeatOf(int32_t pid, bool is_exclusive = true) {
  return {.host = "there", .pid = pid, .streams = {{.channel = "POSE", .is_exclusive = is_exclusive}}};
}

TEST(Neighbors, TheYoungerNamesakeIsInConflict) {
  Neighbors younger(Own());
  younger.OnHeartbeat("tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0);
  const auto sentence = younger.ConflictOverName(0);
  ASSERT_TRUE(sentence);
  EXPECT_NE(sentence->find("process 8 on there"), std::string::npos) << *sentence;

  Neighbors older(Own());
  older.OnHeartbeat("tracker", kOwnEpochUs + 1, HeartbeatOf(8), 0);
  EXPECT_FALSE(older.ConflictOverName(0));
}

TEST(Neighbors, AChannelBelongsToItsOldestPublisher) {
  Neighbors neighbors(Own());
  neighbors.OnHeartbeat("other_tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0);
  EXPECT_TRUE(neighbors.ConflictOverChannel("POSE", 0));
  EXPECT_FALSE(neighbors.ConflictOverChannel("KEYFRAME", 0));
  EXPECT_FALSE(neighbors.ConflictOverName(0));
}

TEST(Neighbors, SharedChannelsAreNoConflict) {
  Neighbors neighbors(Own());
  neighbors.OnHeartbeat("other", kOwnEpochUs - 1, HeartbeatOf(8, false), 0);
  EXPECT_FALSE(neighbors.ConflictOverChannel("POSE", 0));
}

TEST(Neighbors, AProcessThatIsSilentForASecondIsGone) {
  Neighbors neighbors(Own());
  EXPECT_TRUE(neighbors.OnHeartbeat("tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0)) << "it is new";
  EXPECT_TRUE(neighbors.ConflictOverName(1'000'000));
  EXPECT_FALSE(neighbors.ConflictOverName(1'000'001));
}

TEST(Neighbors, ItsOwnHeartbeatIsIgnored) {
  Neighbors neighbors(Own());
  neighbors.OnHeartbeat("tracker", kOwnEpochUs, {.host = "here", .pid = 7, .streams = {}}, 0);
  EXPECT_FALSE(neighbors.ConflictOverName(0));
}

}  // namespace
}  // namespace tessera
