#include "tracking/latency_watch.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kIntervalUs = 100'000;  // of the camera

// Frame `id` of a camera that takes one every kIntervalUs; its pose comes so late.
std::optional<std::string> Note(LatencyWatch& watch, int64_t id, int64_t latency_us) {
  const int64_t captured_us = 1'700'000'000'000'000 + kIntervalUs * id;
  return watch.Note(FrameId{id}, captured_us, captured_us + latency_us);
}

TEST(LatencyWatch, AFewIntervalsAreOrdinary) {
  LatencyWatch watch;
  for (int64_t id = 0; id < 50; ++id) EXPECT_FALSE(Note(watch, id, 2 * kIntervalUs));
}

TEST(LatencyWatch, SaysWhatIsLateOnceInAWhile) {
  LatencyWatch watch;
  for (int64_t id = 0; id < 10; ++id) EXPECT_FALSE(Note(watch, id, 20'000));
  const auto sentence = Note(watch, 10, 950'000);
  ASSERT_TRUE(sentence);
  EXPECT_EQ(sentence->substr(0, sentence->find(':')),
            "the pose of frame 10 came 950 ms after the frame was taken, 9.5 frame intervals");
  EXPECT_FALSE(Note(watch, 11, 950'000));
  EXPECT_TRUE(Note(watch, 11 + LatencyWatch::kPeriodUs / kIntervalUs, 950'000));
}

TEST(LatencyWatch, DroppedFramesDoNotMakeTheIntervalLonger) {
  LatencyWatch watch;
  for (int64_t id = 0; id < 40; id += 4) EXPECT_FALSE(Note(watch, id, 20'000));
  EXPECT_TRUE(Note(watch, 40, 350'000));
}

}  // namespace
}  // namespace tessera
