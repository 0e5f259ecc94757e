#include "evaluation/run_end.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kSecond = 1'000'000;

EndOfStream TrackerEnd(int64_t num_frames) { return {.stage = StageKind::kTracker, .num_frames = num_frames}; }
EndOfStream MapperEnd(int64_t num_deltas) { return {.stage = StageKind::kMapper, .num_values = num_deltas}; }

// A run of 10 frames and 3 deltas, of which everything came at second 5.
RunEnd Complete() {
  RunEnd end("evaluator");
  end.NoteEnd(TrackerEnd(10), 5 * kSecond);
  end.NoteEnd(MapperEnd(3), 5 * kSecond);
  end.NotePose({9}, 5 * kSecond);
  end.NoteMap(3, 5 * kSecond);
  end.NoteRemoved(2);
  return end;
}

TEST(RunEnd, IsReachedWhenPosesMapAndRemovalsAreThere) {
  EXPECT_TRUE(Complete().IsReached(5 * kSecond));

  RunEnd no_last_pose("evaluator");
  no_last_pose.NoteEnd(TrackerEnd(10), 0);
  no_last_pose.NoteEnd(MapperEnd(0), 0);
  no_last_pose.NotePose({8}, 0);
  EXPECT_FALSE(no_last_pose.IsReached(0));
  no_last_pose.NotePose({9}, 0);
  no_last_pose.NotePose({4}, 0);  // late
  EXPECT_TRUE(no_last_pose.IsReached(0));
}

TEST(RunEnd, AReplicaThatHasToBeReplacedIsNoMap) {
  RunEnd end = Complete();
  end.NoteMap(-1, 5 * kSecond);
  EXPECT_FALSE(end.IsReached(5 * kSecond));
  end.NoteMap(3, 6 * kSecond);
  EXPECT_TRUE(end.IsReached(6 * kSecond));
}

TEST(RunEnd, NothingEndsBeforeTheTracker) {
  RunEnd end("evaluator");
  end.NoteEnd(MapperEnd(0), 0);
  EXPECT_FALSE(end.has_tracker_ended());
  EXPECT_FALSE(end.IsReached(10 * RunEnd::kLastNewsTimeoutUs));
  EXPECT_FALSE(end.NoteEnd({.stage = StageKind::kCamera}, 0)) << "does not matter";
}

TEST(RunEnd, OnlyTheFirstEndOfAStageCounts) {
  RunEnd end("evaluator");
  EXPECT_TRUE(end.NoteEnd(TrackerEnd(10), 0));
  EXPECT_FALSE(end.NoteEnd(TrackerEnd(5), 0));
  EXPECT_TRUE(end.has_tracker_ended());
}

TEST(RunEnd, AStageThatWasAliveLatelyIsWaitedForUpToASecond) {
  RunEnd end = Complete();
  end.NoteStatus("evaluator", 4 * kSecond + kSecond / 2);
  end.NoteStatus("camera", kSecond);  // dead
  EXPECT_TRUE(RunEnd(end).IsReached(5 * kSecond)) << "neither the asking stage nor a dead one is waited for";
  end.NoteStatus("mapper", 4 * kSecond + kSecond / 2);
  EXPECT_FALSE(end.IsReached(5 * kSecond));
  RunEnd late = end;
  EXPECT_TRUE(late.IsReached(6 * kSecond)) << "the mapper says nothing more";
  end.NoteStatus("mapper", 5 * kSecond + 1);
  EXPECT_TRUE(end.IsReached(5 * kSecond + 2));
}

TEST(RunEnd, WhatDoesNotComeIsGivenUpTwoMinutesAfterTheLastNews) {
  RunEnd end("evaluator");
  end.NoteEnd(TrackerEnd(10), 0);
  end.NotePose({5}, 60 * kSecond);
  EXPECT_FALSE(end.IsReached(60 * kSecond + RunEnd::kLastNewsTimeoutUs));
  EXPECT_TRUE(end.IsReached(61 * kSecond + RunEnd::kLastNewsTimeoutUs));
}

}  // namespace
}  // namespace tessera
