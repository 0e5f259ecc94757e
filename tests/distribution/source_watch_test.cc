#include "distribution/source_watch.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kSecondUs = 1'000'000;

TEST(SourceWatch, SaysOnceThatTheSourceFellSilentAndOnceThatItIsBack) {
  SourceWatch watch(0);
  EXPECT_FALSE(watch.NoteFrame(0));
  EXPECT_FALSE(watch.Look(kSecondUs)) << "a slow camera";
  EXPECT_EQ(watch.SilenceUs(kSecondUs), 0);
  EXPECT_EQ(watch.Look(2 * kSecondUs), "no image for 2.0 s: the run waits for the source");
  EXPECT_FALSE(watch.Look(8 * kSecondUs));
  EXPECT_EQ(watch.SilenceUs(8 * kSecondUs), 8 * kSecondUs);
  EXPECT_EQ(watch.NoteFrame(8 * kSecondUs + 250'000), "images come again, after 8.2 s of silence");
  EXPECT_FALSE(watch.NoteFrame(9 * kSecondUs));
  EXPECT_EQ(watch.SilenceUs(9 * kSecondUs), 0);
}

TEST(SourceWatch, ASourceThatNeverBeginsIsSilentToo) {
  SourceWatch watch(0);
  EXPECT_FALSE(watch.Look(50 * kSecondUs)) << "the first look";
  EXPECT_FALSE(watch.Look(60 * kSecondUs)) << "it is being opened";
  EXPECT_TRUE(watch.Look(65 * kSecondUs));
}

TEST(SourceWatch, GivesUpWhenToldTo) {
  SourceWatch watch(10 * kSecondUs);
  watch.NoteFrame(0);
  EXPECT_TRUE(watch.Look(3 * kSecondUs));
  EXPECT_FALSE(watch.Look(9 * kSecondUs));
  EXPECT_FALSE(watch.has_given_up());
  EXPECT_EQ(watch.Look(10 * kSecondUs), "no image for 10.0 s: the source is given up, and the run ends");
  EXPECT_TRUE(watch.has_given_up());
  EXPECT_FALSE(watch.Look(20 * kSecondUs));
}

TEST(SourceWatch, WithoutALimitItWaitsForEver) {
  SourceWatch watch(0);
  watch.NoteFrame(0);
  watch.Look(100'000 * kSecondUs);
  EXPECT_FALSE(watch.has_given_up());
}

}  // namespace
}  // namespace tessera
