#include "tracking/delta_schedule.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

std::shared_ptr<const MapDelta> Answer(int64_t keyframe) {
  auto delta = std::make_shared<MapDelta>();
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
  schedule.Receive(Answer(1));  // not the one that is missing
  EXPECT_FALSE(schedule.CanTrack({7}));
  schedule.Receive(Answer(0));
  EXPECT_TRUE(schedule.CanTrack({7}));
  EXPECT_EQ(schedule.Take({7}).front()->answers, KeyframeId{0});
  EXPECT_EQ(schedule.Take({8}).front()->answers, KeyframeId{1});
}

// Frames may be dropped: the next one sees all that is due by then, in order.
TEST(DeltaSchedule, CatchesUpAfterDroppedFrames) {
  DeltaSchedule schedule(2);
  for (int64_t k = 0; k < 3; ++k) {
    schedule.KeyframeSent({k}, {k});
    schedule.Receive(Answer(2 - k));
  }
  const auto deltas = schedule.Take({9});
  ASSERT_EQ(deltas.size(), 3U);
  for (int64_t k = 0; k < 3; ++k) EXPECT_EQ(deltas[static_cast<size_t>(k)]->answers, KeyframeId{k});
}

}  // namespace
}  // namespace tessera
