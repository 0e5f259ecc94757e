// Of two processes with one name, or two publishers of one channel, the younger has to end.
#include "runtime/neighbours.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kOwnEpochUs = 1000;

StageIdentity Own() { return {.name = "tracker", .epoch_us = kOwnEpochUs, .host = "here", .pid = 7}; }

Heartbeat HeartbeatOf(int32_t pid, bool is_exclusive = true) {
  return {.host = "there", .pid = pid, .streams = {{.channel = "POSE", .is_exclusive = is_exclusive}}};
}

TEST(Neighbours, TheYoungerNamesakeIsInConflict) {
  Neighbours younger(Own());
  younger.OnHeartbeat("tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0);
  const auto sentence = younger.ConflictOverName(0);
  ASSERT_TRUE(sentence);
  EXPECT_NE(sentence->find("process 8 on there"), std::string::npos) << *sentence;

  Neighbours older(Own());
  older.OnHeartbeat("tracker", kOwnEpochUs + 1, HeartbeatOf(8), 0);
  EXPECT_FALSE(older.ConflictOverName(0));
}

TEST(Neighbours, AChannelBelongsToItsOldestPublisher) {
  Neighbours neighbours(Own());
  neighbours.OnHeartbeat("other_tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0);
  EXPECT_TRUE(neighbours.ConflictOverChannel("POSE", 0));
  EXPECT_FALSE(neighbours.ConflictOverChannel("KEYFRAME", 0));
  EXPECT_FALSE(neighbours.ConflictOverName(0));
}

TEST(Neighbours, SharedChannelsAreNoConflict) {
  Neighbours neighbours(Own());
  neighbours.OnHeartbeat("other", kOwnEpochUs - 1, HeartbeatOf(8, false), 0);
  EXPECT_FALSE(neighbours.ConflictOverChannel("POSE", 0));
}

TEST(Neighbours, AProcessThatIsSilentForASecondIsGone) {
  Neighbours neighbours(Own());
  neighbours.OnHeartbeat("tracker", kOwnEpochUs - 1, HeartbeatOf(8), 0);
  EXPECT_TRUE(neighbours.ConflictOverName(1'000'000));
  EXPECT_FALSE(neighbours.ConflictOverName(1'000'001));
}

TEST(Neighbours, ItsOwnHeartbeatIsIgnored) {
  Neighbours neighbours(Own());
  neighbours.OnHeartbeat("tracker", kOwnEpochUs, {.host = "here", .pid = 7, .streams = {}}, 0);
  EXPECT_FALSE(neighbours.ConflictOverName(0));
}

}  // namespace
}  // namespace tessera
