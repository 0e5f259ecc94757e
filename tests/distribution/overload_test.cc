#include "distribution/overload.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kPeriodUs = Overload::kPeriodUs;

TEST(Overload, SaysAfterEachPeriodWhatTheMachineHandles) {
  Overload overload;
  for (int frame = 0; frame <= 50; ++frame) {
    overload.NoteArrival(100'000 * frame);
    if (frame % 5 == 4) overload.NoteDrop();
  }
  EXPECT_FALSE(overload.Look(kPeriodUs - 1));
  EXPECT_EQ(overload.Look(kPeriodUs), "dropped 10 of 51 frames: the machine handles 8.0 frames a second of 10.0");
  EXPECT_FALSE(overload.Look(kPeriodUs + 1)) << "once each period";
}

TEST(Overload, CountsAllFramesButTellsTheRatesOfThePeriod) {
  Overload overload;
  for (int frame = 0; frame <= 50; ++frame) overload.NoteArrival(100'000 * frame);
  EXPECT_FALSE(overload.Look(kPeriodUs)) << "nothing was dropped";
  for (int frame = 1; frame <= 100; ++frame) overload.NoteArrival(kPeriodUs + 50'000 * frame);
  for (int frame = 0; frame < 75; ++frame) overload.NoteDrop();
  EXPECT_EQ(overload.Look(2 * kPeriodUs), "dropped 75 of 151 frames: the machine handles 5.0 frames a second of 20.0");
  EXPECT_FALSE(overload.Look(4 * kPeriodUs)) << "it is over";
}

TEST(Overload, ASilentSourceIsNotASlowOne) {
  Overload overload;
  for (int frame = 0; frame <= 10; ++frame) overload.NoteArrival(100'000 * frame);
  for (int frame = 0; frame <= 10; ++frame) overload.NoteArrival(8'000'000 + 100'000 * frame);
  for (int frame = 0; frame < 3; ++frame) overload.NoteDrop();
  // 20 intervals of 0.1 s, and a second of the pause.
  EXPECT_EQ(overload.Look(9'000'000), "dropped 3 of 22 frames: the machine handles 6.0 frames a second of 7.0");
}

TEST(Overload, SaysNothingBeforeTheFirstFrame) { EXPECT_FALSE(Overload().Look(10 * kPeriodUs)); }

}  // namespace
}  // namespace tessera
