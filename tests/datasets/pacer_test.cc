#include "datasets/pacer.h"

#include <gtest/gtest.h>

#include "core/errors.h"

namespace tessera {
namespace {

TEST(ParsePace, KnowsWordsAndFactors) {
  EXPECT_EQ(ParsePace("lockstep").kind, PacerOptions::Kind::kLockstep);
  EXPECT_EQ(ParsePace("realtime").kind, PacerOptions::Kind::kTimed);
  EXPECT_EQ(ParsePace("realtime").speed, 1.0);
  EXPECT_EQ(ParsePace("2.5").speed, 2.5);
  for (const char* text : {"", "fast", "0", "-1", "1x", "inf", "nan"}) {
    EXPECT_THROW(ParsePace(text), InputError) << text;
  }
}

TEST(Pacer, LockstepKeepsAtMostTheWindowAhead) {
  Pacer pacer({.kind = PacerOptions::Kind::kLockstep, .lockstep_window = 3});
  int64_t frame = 10;
  for (; pacer.MayGo(0, 0); ++frame) {
    pacer.MarkSent(FrameId{frame});
  }
  EXPECT_EQ(frame, 13);
  pacer.MarkTracked(FrameId{9});  // of a stream before this one
  EXPECT_FALSE(pacer.MayGo(0, 0));
  pacer.MarkTracked(FrameId{11});  // and so frame 10, whose pose may have been lost
  EXPECT_EQ(pacer.num_ahead(), 1);
  EXPECT_TRUE(pacer.MayGo(0, 0));
}

TEST(Pacer, TimedFollowsTheSourcesTimestamps) {
  Pacer pacer({.kind = PacerOptions::Kind::kTimed, .speed = 2.0});
  EXPECT_TRUE(pacer.MayGo(1'000'000, 50));
  EXPECT_FALSE(pacer.MayGo(1'100'000, 50));
  EXPECT_FALSE(pacer.MayGo(1'100'000, 50'049));
  EXPECT_TRUE(pacer.MayGo(1'100'000, 50'050));
  EXPECT_TRUE(pacer.MayGo(1'200'000, 900'000));  // late: at once
  EXPECT_FALSE(pacer.MayGo(5'000'000, 900'000));
}

TEST(Pacer, TimeAloneLetsTimedFramesGoWhenTheyAreDue) {
  Pacer pacer({.kind = PacerOptions::Kind::kTimed, .speed = 3.0});
  EXPECT_EQ(pacer.DueUs(0), std::nullopt) << "its clock has not begun";
  ASSERT_TRUE(pacer.MayGo(1'000'000, 50));
  for (int64_t utime_us = 1'000'000; utime_us < 1'000'050; ++utime_us) {
    const int64_t due_us = pacer.DueUs(utime_us).value();
    EXPECT_TRUE(pacer.MayGo(utime_us, due_us));
    EXPECT_FALSE(pacer.MayGo(utime_us, due_us - 1));
  }
  EXPECT_EQ(Pacer({.kind = PacerOptions::Kind::kLockstep}).DueUs(0), std::nullopt);
}

TEST(Pacer, AFrameIsAsOldAsItsTimeIsPast) {
  Pacer pacer({.kind = PacerOptions::Kind::kTimed, .speed = 2.0});
  ASSERT_TRUE(pacer.MayGo(1'000'000, 50));
  EXPECT_EQ(pacer.LatenessUs(1'000'000, 50), 0);
  EXPECT_EQ(pacer.LatenessUs(1'100'000, 50'350), 300) << "it was due at 50'050";
  EXPECT_EQ(pacer.LatenessUs(1'100'000, 50'000), 0);
  Pacer lockstep({.kind = PacerOptions::Kind::kLockstep});
  EXPECT_EQ(lockstep.LatenessUs(1'000'000, 900'000), 0) << "no camera is waited for";
}

TEST(Pacer, FreeNeverWaits) {
  Pacer pacer({.kind = PacerOptions::Kind::kFree});
  for (int frame = 0; frame < 100; ++frame) {
    EXPECT_TRUE(pacer.MayGo(0, 0));
    pacer.MarkSent(FrameId{frame});
  }
}

}  // namespace
}  // namespace tessera
