#include "tracking/delta_schedule.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// The mapper's answer to a keyframe; each has its number.
DeltaSchedule::Delta Answer(int64_t keyframe) {
  auto delta = std::make_shared<MapDelta>();
  delta->number = keyframe;
  delta->answers = {keyframe};
  return delta;
}

TEST(DeltaSchedule, HoldsBackWhatComesEarly) {
  DeltaSchedule schedule(3);
  schedule.KeyframeSent({0}, {10});
  schedule.Receive(Answer(0));
  for (int64_t frame = 11; frame < 13; ++frame) {
    EXPECT_TRUE(schedule.CanTrack({frame}));
    EXPECT_TRUE(schedule.Take({frame}).empty());
  }
  EXPECT_EQ(schedule.Take({13}).size(), 1U);
  EXPECT_TRUE(schedule.Take({14}).empty());
}

TEST(DeltaSchedule, WaitsForWhatIsLate) {
  DeltaSchedule schedule(2);
  schedule.KeyframeSent({0}, {5});
  schedule.KeyframeSent({1}, {6});
  EXPECT_TRUE(schedule.CanTrack({6}));
  EXPECT_FALSE(schedule.CanTrack({7}));
  schedule.Receive(Answer(0));
  EXPECT_TRUE(schedule.CanTrack({7}));
  EXPECT_FALSE(schedule.CanTrack({8}));
  schedule.Receive(Answer(1));
  EXPECT_EQ(schedule.Take({7}).front()->answers, KeyframeId{0});
  EXPECT_EQ(schedule.Take({8}).front()->answers, KeyframeId{1});
}

// Frames may be dropped: the next one sees all that is due by then, in order.
TEST(DeltaSchedule, CatchesUpAfterDroppedFrames) {
  DeltaSchedule schedule(2);
  for (int64_t k = 0; k < 3; ++k) {
    schedule.KeyframeSent({k}, {k});
    schedule.Receive(Answer(k));
    schedule.Receive(Answer(k));  // asked for again, and come twice
  }
  const auto deltas = schedule.Take({9});
  ASSERT_EQ(deltas.size(), 3U);
  for (int64_t k = 0; k < 3; ++k) EXPECT_EQ(deltas[static_cast<size_t>(k)]->answers, KeyframeId{k});
}

TEST(DeltaSchedule, ASnapshotAnswersAllBeforeIt) {
  DeltaSchedule schedule(1);
  for (int64_t k = 0; k < 4; ++k) schedule.KeyframeSent({k}, {k});
  schedule.Receive(Answer(0));
  schedule.SkipTo(*Answer(2));
  EXPECT_TRUE(schedule.CanTrack({3}));
  EXPECT_TRUE(schedule.Take({3}).empty());
  EXPECT_FALSE(schedule.CanTrack({4}));
  schedule.Receive(Answer(1));  // a straggler
  schedule.Receive(Answer(3));
  const auto deltas = schedule.Take({4});
  ASSERT_EQ(deltas.size(), 1U);
  EXPECT_EQ(deltas.front()->number, 3);
}

TEST(DeltaSchedule, LiveTakesWhatIsThereAndARecordingRepeatsIt) {
  // Keyframe k goes out at frame k, its answer comes in some later frame.
  const std::vector<int64_t> comes_at = {1, 4, 4, 5, 9};
  DeltaSchedule live = DeltaSchedule::Live();
  EXPECT_FALSE(live.follows_logical_time());
  DeltaSchedule::Steps steps;
  int64_t num_applied = 0;
  for (int64_t frame = 0; frame < 10; ++frame) {
    for (int64_t k = 0; k < 5; ++k) {
      if (comes_at[static_cast<size_t>(k)] == frame) live.Receive(Answer(k));
    }
    EXPECT_TRUE(live.CanTrack({frame}));
    num_applied += static_cast<int64_t>(live.Take({frame}).size());
    steps[{frame}] = num_applied;
    if (frame < 5) live.KeyframeSent({frame}, {frame});
  }
  DeltaSchedule replay = DeltaSchedule::Recorded(steps);
  num_applied = 0;
  int64_t num_received = 0;
  for (int64_t frame = 0; frame < 10; ++frame) {
    // Here every answer is late: it comes only when it is waited for.
    while (!replay.CanTrack({frame})) replay.Receive(Answer(num_received++));
    num_applied += static_cast<int64_t>(replay.Take({frame}).size());
    EXPECT_EQ(num_applied, (steps[{frame}])) << frame;
    if (frame < 5) replay.KeyframeSent({frame}, {frame});
  }
  EXPECT_EQ(num_applied, 5);
}

TEST(DeltaSchedule, ARecordingOfMoreDeltasThanAreMadeDoesNotStop) {
  DeltaSchedule replay = DeltaSchedule::Recorded({{{5}, 3}});
  replay.KeyframeSent({0}, {1});
  EXPECT_FALSE(replay.CanTrack({5}));
  replay.Receive(Answer(0));
  EXPECT_TRUE(replay.CanTrack({5}));
  EXPECT_EQ(replay.Take({5}).size(), 1U);
}

}  // namespace
}  // namespace tessera
