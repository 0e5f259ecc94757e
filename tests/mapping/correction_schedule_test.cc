#include "mapping/correction_schedule.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace tessera {
namespace {

constexpr int64_t kFirstDelta = 100;  // of the delta that answers keyframe 0
constexpr CorrectionDelays kDelays{.loop_keyframes = 3, .adjustment_keyframes = 5, .adjustment_growth = 1000};

// Keyframes 4, 11, 18, ... close a loop; the others don't.
LoopResult ResultOf(int64_t keyframe) {
  LoopResult result;
  result.answers = {keyframe};
  if (keyframe % 7 == 4) result.matched = {keyframe - 4};
  return result;
}

GlobalAdjustment AdjustmentOf(int64_t keyframe) {
  GlobalAdjustment adjustment;
  adjustment.answers = {keyframe};
  adjustment.delta = keyframe + kFirstDelta;
  return adjustment;
}

// What is applied before each keyframe, in words.
std::string Describe(int64_t keyframe, const DueCorrections& due) {
  std::string words = std::to_string(keyframe) + ":";
  for (const LoopResult& loop : due.loops) words += " loop " + std::to_string(loop.answers.value);
  if (due.adjustment) words += " adjustment " + std::to_string(due.adjustment->answers.value);
  return words + "\n";
}

// A mapper that asks for an adjustment when it closed a loop and none is on its way, and gets answers whenever
// `deliver` is called; those of keyframes that it has not processed yet may come too (from before it was started
// again).
class MapperRun {
 public:
  explicit MapperRun(int64_t num_keyframes) : num_keyframes_(num_keyframes) {}

  template <class Deliver>
  std::string Go(Deliver deliver) {
    std::string words;
    for (int64_t k = 0; k < num_keyframes_; ++k) {
      while (!schedule_.CanProcess({k})) deliver(schedule_, k);
      const DueCorrections due = schedule_.Take({k});
      Note(k, due);
      words += Describe(k, due);
    }
    const KeyframeId last{num_keyframes_ - 1};
    while (!schedule_.CanFinish(last)) deliver(schedule_, num_keyframes_);
    return words + Describe(-1, schedule_.TakeAll(last));
  }

 private:
  void Note(int64_t k, const DueCorrections& due) {
    wants_ |= !due.loops.empty();
    if (!wants_ || schedule_.asked_delta()) return;
    schedule_.Ask({k}, k + kFirstDelta);
    wants_ = false;
  }

  const int64_t num_keyframes_;
  CorrectionSchedule schedule_{kDelays};
  bool wants_ = false;
};

// Everything that will ever be sent, in random order, one at a time as it is waited for; each twice.
std::string InRandomOrder(int64_t num_keyframes, unsigned seed) {
  std::mt19937 generator(seed);
  std::vector<int64_t> messages;  // 2 k: result of keyframe k, 2 k + 1: the adjustment
  for (int64_t i = 0; i < 4 * num_keyframes; ++i) messages.push_back(i / 2);
  std::shuffle(messages.begin(), messages.end(), generator);
  size_t next = 0;
  return MapperRun(num_keyframes).Go([&](CorrectionSchedule& schedule, int64_t) {
    const int64_t message = messages.at(next++);
    if (message % 2 == 0) {
      schedule.Receive(ResultOf(message / 2));
    } else {
      schedule.Receive(AdjustmentOf(message / 2));
    }
  });
}

TEST(CorrectionSchedule, WhatIsDueWhenDoesNotDependOnArrival) {
  const int64_t num_keyframes = 60;
  // As late as can be: what is missing comes when it is waited for, one keyframe's at a time.
  int64_t sent = 0;
  const std::string lazy = MapperRun(num_keyframes).Go([&](CorrectionSchedule& schedule, int64_t k) {
    if (sent <= k - kDelays.loop_keyframes || k == num_keyframes) {
      schedule.Receive(ResultOf(sent++));
    }
    for (int64_t asked = 0; asked < k; ++asked) schedule.Receive(AdjustmentOf(asked));
  });
  EXPECT_NE(lazy.find("7: loop 4\n"), std::string::npos) << lazy;
  EXPECT_NE(lazy.find("12: adjustment 7\n"), std::string::npos) << lazy;
  EXPECT_NE(lazy.find("14: loop 11\n"), std::string::npos) << lazy;
  for (unsigned seed = 0; seed < 10; ++seed) EXPECT_EQ(InRandomOrder(num_keyframes, seed), lazy) << seed;
}

TEST(CorrectionSchedule, ALoopIsDueExactlyAfterItsDelay) {
  CorrectionSchedule schedule(kDelays);
  for (const int64_t k : {0, 1, 2}) {
    EXPECT_TRUE(schedule.CanProcess({k})) << "nothing is due before keyframe 3";
    EXPECT_TRUE(schedule.Take({k}).loops.empty());
  }
  EXPECT_FALSE(schedule.CanProcess({3}));
  for (int64_t k = 4; k >= 1; --k) schedule.Receive(ResultOf(k));  // far too early, and in the wrong order
  EXPECT_FALSE(schedule.CanProcess({3})) << "the result of keyframe 0 is missing";
  schedule.Receive(ResultOf(0));
  for (int64_t k = 3; k < 7; ++k) {
    ASSERT_TRUE(schedule.CanProcess({k}));
    EXPECT_TRUE(schedule.Take({k}).loops.empty()) << "the loop of keyframe 4 came early for keyframe " << k;
  }
  ASSERT_TRUE(schedule.CanProcess({7}));
  const DueCorrections due = schedule.Take({7});
  ASSERT_EQ(due.loops.size(), 1U);
  EXPECT_EQ(due.loops[0].answers, KeyframeId{4});
  EXPECT_FALSE(schedule.CanProcess({8}));
}

TEST(CorrectionSchedule, AnAdjustmentIsDueExactlyAfterItsDelay) {
  CorrectionSchedule schedule(kDelays);
  for (int64_t k = 0; k < 30; ++k) {
    LoopResult none;
    none.answers = {k};
    schedule.Receive(none);
  }
  schedule.Receive(AdjustmentOf(10));  // nobody asked yet
  (void)schedule.Take({10});
  schedule.Ask({10}, 10 + kFirstDelta);
  EXPECT_EQ(schedule.asked_delta(), 10 + kFirstDelta);
  for (int64_t k = 11; k < 15; ++k) {
    ASSERT_TRUE(schedule.CanProcess({k}));
    EXPECT_FALSE(schedule.Take({k}).adjustment.has_value()) << k;
  }
  EXPECT_TRUE(schedule.Take({15}).adjustment.has_value());
  EXPECT_FALSE(schedule.asked_delta().has_value());
  schedule.Ask({15}, 15 + kFirstDelta);
  EXPECT_TRUE(schedule.CanProcess({19}));
  EXPECT_FALSE(schedule.CanProcess({20})) << "an adjustment for keyframe 15 is missing";
  schedule.Receive(AdjustmentOf(14));
  EXPECT_FALSE(schedule.CanProcess({20})) << "this is another one";
  schedule.Receive(AdjustmentOf(15));
  EXPECT_TRUE(schedule.CanProcess({20}));
}

// A mapper that was started again gets all that was ever sent before its first keyframe.
TEST(CorrectionSchedule, TheAdjustmentOfALargerMapGetsMoreTime) {
  for (const int64_t asked : {15, 16, 160}) {
    CorrectionSchedule schedule({.loop_keyframes = 1000, .adjustment_keyframes = 5, .adjustment_growth = 16});
    schedule.Ask({asked}, asked + kFirstDelta);
    schedule.Receive(AdjustmentOf(asked));
    const int64_t due = asked + 5 + asked / 16;
    EXPECT_FALSE(schedule.Take({due - 1}).adjustment.has_value()) << asked;
    EXPECT_TRUE(schedule.Take({due}).adjustment.has_value()) << asked;
  }
}

TEST(CorrectionSchedule, LaterAdjustmentsSurviveTheTakingOfEarlierOnes) {
  CorrectionSchedule schedule(kDelays);
  for (int64_t k = 0; k < 30; ++k) schedule.Receive(ResultOf(k));
  for (const int64_t k : {7, 14, 21}) schedule.Receive(AdjustmentOf(k));
  for (const int64_t asked : {7, 14, 21}) {
    schedule.Ask({asked}, asked + kFirstDelta);
    ASSERT_TRUE(schedule.CanProcess({asked + 5})) << asked;
    EXPECT_EQ(schedule.Take({asked + 5}).adjustment.value().answers, KeyframeId{asked});
  }
}

TEST(CorrectionSchedule, AtTheEndEverythingIsDue) {
  CorrectionSchedule schedule(kDelays);
  for (int64_t k = 0; k < 11; ++k) schedule.Receive(ResultOf(k));
  (void)schedule.Take({10});
  schedule.Ask({10}, 10 + kFirstDelta);
  EXPECT_FALSE(schedule.CanFinish({11}));
  schedule.Receive(AdjustmentOf(10));
  EXPECT_FALSE(schedule.CanFinish({11})) << "the last keyframe's result is missing";
  schedule.Receive(ResultOf(11));
  ASSERT_TRUE(schedule.CanFinish({11}));
  const DueCorrections due = schedule.TakeAll({11});
  ASSERT_EQ(due.loops.size(), 1U);
  EXPECT_EQ(due.loops[0].answers, KeyframeId{11});
  EXPECT_TRUE(due.adjustment.has_value());
  EXPECT_TRUE(schedule.CanFinish({11})) << "nothing is left to wait for";
  EXPECT_TRUE(schedule.TakeAll({11}).loops.empty());
}

// At the end of a run several deltas answer the last keyframe.
TEST(CorrectionSchedule, AdjustmentsOfOneKeyframeAreToldApart) {
  CorrectionSchedule schedule(kDelays);
  for (int64_t k = 0; k < 4; ++k) schedule.Receive(ResultOf(k));
  GlobalAdjustment first = AdjustmentOf(3), second = first;
  ++second.delta;
  second.is_usable = true;
  schedule.Receive(first);
  schedule.Receive(second);
  schedule.Ask({3}, first.delta);
  ASSERT_TRUE(schedule.CanFinish({3}));
  EXPECT_FALSE(schedule.TakeAll({3}).adjustment.value().is_usable);
  schedule.Ask({3}, second.delta);
  ASSERT_TRUE(schedule.CanFinish({3}));
  EXPECT_TRUE(schedule.TakeAll({3}).adjustment.value().is_usable);
}

TEST(CorrectionSchedule, KeyframesOfALoadedMapHaveNoResults) {
  CorrectionSchedule schedule(kDelays);
  schedule.BeginAt({20});
  schedule.Receive(ResultOf(18));  // of the run that made the map
  for (const int64_t k : {20, 21, 22}) {
    ASSERT_TRUE(schedule.CanProcess({k})) << k;
    EXPECT_TRUE(schedule.Take({k}).loops.empty()) << k;
  }
  EXPECT_FALSE(schedule.CanProcess({23}));
  schedule.Receive(ResultOf(20));
  EXPECT_TRUE(schedule.CanProcess({23}));
}

TEST(CorrectionSchedule, TheFirstOfTwoAnswersCounts) {
  CorrectionSchedule schedule(kDelays);
  LoopResult first = ResultOf(4), second = first;
  first.num_candidates = 1;
  second.num_candidates = 2;
  for (int64_t k = 0; k < 4; ++k) schedule.Receive(ResultOf(k));
  schedule.Receive(first);
  schedule.Receive(second);
  EXPECT_EQ(schedule.Take({7}).loops.at(0).num_candidates, 1);
  schedule.Receive(second);  // again, long after
  schedule.Receive(ResultOf(5));
  EXPECT_TRUE(schedule.Take({8}).loops.empty());
}

}  // namespace
}  // namespace tessera
