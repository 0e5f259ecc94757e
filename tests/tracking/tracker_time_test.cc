#include "tracking/tracker_time.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// The mapper's answer to a keyframe; each has its number.
TrackerTime::Delta Answer(int64_t keyframe) {
  auto delta = std::make_shared<MapDelta>();
  delta->number = keyframe;
  delta->answers = {keyframe};
  return delta;
}

TEST(LogicalTime, HoldsBackWhatComesEarly) {
  LogicalTime time(3);
  time.KeyframeSent({0}, {10}, 0);
  time.Receive(Answer(0));
  for (int64_t frame = 11; frame < 13; ++frame) {
    EXPECT_TRUE(time.HasDeltas({frame}));
    EXPECT_TRUE(time.TakeDeltas({frame}).empty());
  }
  EXPECT_EQ(time.TakeDeltas({13}).size(), 1U);
  EXPECT_TRUE(time.TakeDeltas({14}).empty());
}

TEST(LogicalTime, WaitsForWhatIsLate) {
  LogicalTime time(2);
  time.KeyframeSent({0}, {5}, 0);
  time.KeyframeSent({1}, {6}, 0);
  EXPECT_TRUE(time.HasDeltas({6}));
  EXPECT_FALSE(time.HasDeltas({7}));
  time.Receive(Answer(0));
  EXPECT_TRUE(time.HasDeltas({7}));
  EXPECT_FALSE(time.HasDeltas({8}));
  time.Receive(Answer(1));
  EXPECT_EQ(time.TakeDeltas({7}).front()->answers, KeyframeId{0});
  EXPECT_EQ(time.TakeDeltas({8}).front()->answers, KeyframeId{1});
}

// Half a second is enough, whatever D says; at least one frame it is.
TEST(LogicalTime, WaitsForFewerFramesThatComeSlowly) {
  for (const auto& [interval_us, delay] :
       {std::pair<int64_t, int64_t>{100'000, 3}, {200'000, 2}, {500'000, 1}, {2'000'000, 1}}) {
    LogicalTime time(3);
    time.KeyframeSent({0}, {10}, interval_us);
    EXPECT_TRUE(time.HasDeltas({9 + delay})) << interval_us;
    EXPECT_FALSE(time.HasDeltas({10 + delay})) << interval_us;
  }
}

// A keyframe that must be seen sooner brings those before it along.
TEST(LogicalTime, SeesAnswersInTheirOrder) {
  LogicalTime time(3);
  time.KeyframeSent({0}, {10}, 100'000);
  time.KeyframeSent({1}, {11}, 1'000'000);
  time.Receive(Answer(0));
  EXPECT_TRUE(time.HasDeltas({11}));
  EXPECT_FALSE(time.HasDeltas({12}));
  time.Receive(Answer(1));
  EXPECT_EQ(time.TakeDeltas({12}).size(), 2U);
}

// Frames may be dropped: the next one sees all that is due by then, in order.
TEST(LogicalTime, CatchesUpAfterDroppedFrames) {
  LogicalTime time(2);
  for (int64_t k = 0; k < 3; ++k) {
    time.KeyframeSent({k}, {k}, 0);
    time.Receive(Answer(k));
    time.Receive(Answer(k));  // asked for again, and come twice
  }
  const auto deltas = time.TakeDeltas({9});
  ASSERT_EQ(deltas.size(), 3U);
  for (int64_t k = 0; k < 3; ++k) EXPECT_EQ(deltas[static_cast<size_t>(k)]->answers, KeyframeId{k});
}

TEST(LogicalTime, ASnapshotAnswersAllBeforeIt) {
  LogicalTime time(1);
  for (int64_t k = 0; k < 4; ++k) time.KeyframeSent({k}, {k}, 0);
  time.Receive(Answer(0));
  time.SkipTo(*Answer(2));
  EXPECT_TRUE(time.HasDeltas({3}));
  EXPECT_TRUE(time.TakeDeltas({3}).empty());
  EXPECT_FALSE(time.HasDeltas({4}));
  time.Receive(Answer(1));  // a straggler
  time.Receive(Answer(3));
  const auto deltas = time.TakeDeltas({4});
  ASSERT_EQ(deltas.size(), 1U);
  EXPECT_EQ(deltas.front()->number, 3);
}

TEST(LiveTime, TakesWhatIsThereAndARecordingRepeatsIt) {
  // Keyframe k goes out at frame k, its answer comes in some later frame.
  const std::vector<int64_t> comes_at = {1, 4, 4, 5, 9};
  LiveTime live;
  RecordedSteps recorded;
  int64_t num_applied = 0;
  for (int64_t frame = 0; frame < 10; ++frame) {
    for (int64_t k = 0; k < 5; ++k) {
      if (comes_at[static_cast<size_t>(k)] == frame) live.Receive(Answer(k));
    }
    EXPECT_TRUE(live.HasDeltas({frame}));
    num_applied += static_cast<int64_t>(live.TakeDeltas({frame}).size());
    recorded.steps[{frame}] = num_applied;
    if (frame < 5) live.KeyframeSent({frame}, {frame}, 0);
  }
  ReplayTime replay(recorded);
  num_applied = 0;
  int64_t num_received = 0;
  for (int64_t frame = 0; frame < 10; ++frame) {
    // Here every answer is late: it comes only when it is waited for.
    while (!replay.HasDeltas({frame})) replay.Receive(Answer(num_received++));
    num_applied += static_cast<int64_t>(replay.TakeDeltas({frame}).size());
    EXPECT_EQ(num_applied, (recorded.steps[{frame}])) << frame;
    if (frame < 5) replay.KeyframeSent({frame}, {frame}, 0);
  }
  EXPECT_EQ(num_applied, 5);
}

TEST(ReplayTime, ARecordingOfMoreDeltasThanAreMadeDoesNotStop) {
  ReplayTime replay({.steps = {{{5}, 3}}});
  replay.KeyframeSent({0}, {1}, 0);
  EXPECT_FALSE(replay.HasDeltas({5}));
  replay.Receive(Answer(0));
  EXPECT_TRUE(replay.HasDeltas({5}));
  EXPECT_EQ(replay.TakeDeltas({5}).size(), 1U);
}

RelocalizationAnswer AnswerAbout(int64_t frame) {
  RelocalizationAnswer answer;
  answer.frame = {frame};
  return answer;
}

TEST(LogicalTime, AFrameAsksOnceAndWaitsForItsAnswer) {
  LogicalTime time(3);
  EXPECT_TRUE(time.MayAsk({7}));
  EXPECT_TRUE(time.Ask({7}));
  EXPECT_FALSE(time.MayAsk({7}));
  EXPECT_TRUE(time.AwaitsAnswer({7}));
  EXPECT_TRUE(time.has_open_question());
  time.Receive(AnswerAbout(6));
  EXPECT_TRUE(time.AwaitsAnswer({7})) << "another frame's answer";
  time.Receive(AnswerAbout(7));
  time.Receive(AnswerAbout(6));  // repeated
  EXPECT_FALSE(time.AwaitsAnswer({7}));
  EXPECT_FALSE(time.has_open_question());
  ASSERT_NE(time.TakeAnswer({7}), nullptr);
  EXPECT_EQ(time.TakeAnswer({7})->frame, FrameId{7});
  EXPECT_EQ(time.TakeAnswer({8}), nullptr) << "an answer is for the frame that asked";
  EXPECT_TRUE(time.MayAsk({8}));
}

// Mono's first points belong to the first of its two keyframes, and the map has them with the second one's answer.
TEST(LiveTime, TheAnswersToTheKeyframesOfOneFrameAreSeenTogether) {
  LiveTime time;
  time.KeyframeSent({0}, {5}, 0);
  time.KeyframeSent({1}, {5}, 0);
  time.Receive(Answer(0));
  EXPECT_TRUE(time.HasDeltas({6})) << "nothing is waited for";
  EXPECT_TRUE(time.TakeDeltas({6}).empty());
  time.Receive(Answer(1));
  EXPECT_EQ(time.TakeDeltas({7}).size(), 2U);
  time.KeyframeSent({2}, {8}, 0);
  time.Receive(Answer(2));
  EXPECT_EQ(time.TakeDeltas({9}).size(), 1U);
}

TEST(LiveTime, AnAnswerServesTheNextFrameOnceAndOneQuestionIsOpenAtATime) {
  LiveTime time;
  EXPECT_TRUE(time.Ask({7}));
  EXPECT_FALSE(time.AwaitsAnswer({7}));
  EXPECT_FALSE(time.MayAsk({8})) << "the question of frame 7 is open";
  EXPECT_EQ(time.TakeAnswer({8}), nullptr);
  time.Receive(AnswerAbout(7));
  ASSERT_NE(time.TakeAnswer({9}), nullptr);
  EXPECT_EQ(time.TakeAnswer({10}), nullptr);
  EXPECT_TRUE(time.MayAsk({10}));
}

TEST(ReplayTime, FramesAskAndAreAnsweredAsRecorded) {
  ReplayTime time({.relocalized_by = {{{9}, {7}}}, .relocalizations = {{{7}, AnswerAbout(7)}}});
  EXPECT_FALSE(time.MayAsk({6}));
  EXPECT_TRUE(time.MayAsk({7}));
  EXPECT_FALSE(time.Ask({7})) << "nobody is there to answer";
  EXPECT_FALSE(time.has_open_question());
  EXPECT_EQ(time.TakeAnswer({8}), nullptr);
  ASSERT_NE(time.TakeAnswer({9}), nullptr);
  EXPECT_EQ(time.TakeAnswer({9})->frame, FrameId{7});
}

TEST(TrackerTime, NobodyMayAskWhereThatIsTurnedOff) {
  EXPECT_FALSE(LogicalTime(3, false).MayAsk({7}));
  EXPECT_FALSE(LiveTime(false).MayAsk({7}));
}

TEST(MakeTrackerTime, IsLogicalUnlessAskedToBeLive) {
  EXPECT_NE(dynamic_cast<LogicalTime*>(MakeTrackerTime({}, std::nullopt).get()), nullptr);
  EXPECT_NE(dynamic_cast<LiveTime*>(MakeTrackerTime({.is_live = true}, std::nullopt).get()), nullptr);
}

TEST(MakeTrackerTime, ALiveRunIsRepeatedByItsSteps) {
  RecordedSteps live;
  live.is_live = true;
  EXPECT_NE(dynamic_cast<ReplayTime*>(MakeTrackerTime({}, live).get()), nullptr);
  EXPECT_NE(dynamic_cast<LogicalTime*>(MakeTrackerTime({}, RecordedSteps{}).get()), nullptr);
}

TEST(MakeTrackerTime, AsksOnlyIfItMay) {
  EXPECT_TRUE(MakeTrackerTime({.may_ask = true}, std::nullopt)->MayAsk({0}));
  EXPECT_FALSE(MakeTrackerTime({.may_ask = false}, std::nullopt)->MayAsk({0}));
  EXPECT_FALSE(MakeTrackerTime({.is_live = true, .may_ask = false}, std::nullopt)->MayAsk({0}));
}

}  // namespace
}  // namespace tessera
