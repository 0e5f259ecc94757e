#include "mapping/mapper_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "support/synthetic_world.h"

namespace tessera {
namespace {

using State = MapperSession::State;

// A session, and what it has said.
class Stack {
 public:
  explicit Stack(bool closes_loops = true, bool polishes = false)
      : session({.mapper = {.polishes = polishes}, .delays = {.loop_keyframes = 2}, .closes_loops = closes_loops}) {}

  // Keyframe `id` of a stereo drive comes. Returns the state after all steps that can be taken.
  State Keyframe(int64_t id) {
    KeyframeObservation seen;
    seen.id = {id};
    seen.features = world.Take(id).features;
    seen.landmarks.resize(seen.features.keypoints.size());
    seen.world_from_camera = world.Pose(static_cast<double>(id));
    if (id > 0) {
      seen.reference = {id - 1};
      seen.reference_from_camera = world.Pose(static_cast<double>(id - 1)).Inverse() * seen.world_from_camera;
    }
    return Receive(seen);
  }
  State NoLoopAt(int64_t id) {
    LoopResult result;
    result.answers = {id};
    return Receive(result);
  }
  State End(int64_t num_keyframes) {
    return Receive(EndOfStream{.stage = StageKind::kTracker, .num_frames = 100, .num_values = num_keyframes});
  }
  template <class Value>
  State Receive(const Value& value) {
    Note(session.Receive(value));
    while (session.state() == State::kReady || session.state() == State::kEnding) {
      std::optional<MapperStep> step;
      if (!taken.empty() && session.state() == State::kReady) {
        step = std::move(taken.front());
        taken.pop_front();
      }
      Note(session.Advance(step));
    }
    return session.state();
  }
  void Note(const MapperActions& actions) {
    for (const MapperAction& action : actions) {
      std::visit(Overloaded{[&](const std::shared_ptr<const MapDelta>& delta) { deltas.push_back(delta->number); },
                            [&](const RemovedInDelta& delta) { removed.push_back(delta.delta); },
                            [&](const MapperStep& step) { steps.push_back(step); },
                            [&](const MapSnapshotPage& page) { pages.push_back(page.page); },
                            [&](const EndOfStream& end) { ends.push_back(end); },
                            [&](const Fail& fail) { failures.push_back(fail.sentence); },
                            [&](const Finish&) { has_finished = true; }},
                 action);
    }
  }

  SyntheticWorld world{SensorType::kStereo, 0.3};
  MapperSession session;
  std::vector<int64_t> deltas, removed;  // their numbers
  std::vector<MapperStep> steps;
  std::deque<MapperStep> taken;  // by an earlier life
  std::vector<int32_t> pages;
  std::vector<EndOfStream> ends;
  std::vector<std::string> failures;
  bool has_finished = false;
};

TEST(MapperSession, EachKeyframeIsAnsweredByOneDeltaAndWhatItRemoved) {
  Stack stack(false);
  for (int64_t id = 0; id < 4; ++id) EXPECT_EQ(stack.Keyframe(id), State::kAwaitsKeyframe);
  EXPECT_EQ(stack.deltas, (std::vector<int64_t>{0, 1, 2, 3}));
  EXPECT_EQ(stack.removed, stack.deltas);
}

TEST(MapperSession, StepsOfAnEarlierLifeAreRepeatedWithoutTheirWork) {
  constexpr int64_t kNum = 14;
  Stack first(false);
  std::vector<uint64_t> hashes;
  for (int64_t id = 0; id < kNum; ++id) {
    first.Keyframe(id);
    hashes.push_back(first.session.map().hash());
  }
  ASSERT_EQ(first.steps.size(), static_cast<size_t>(kNum));
  for (const int64_t num_taken : {1, 6, 13}) {
    Stack second(false);
    second.taken.assign(first.steps.begin(), first.steps.begin() + num_taken);
    for (int64_t id = 0; id < kNum; ++id) {
      second.Keyframe(id);
      EXPECT_EQ(second.session.map().hash(), hashes[static_cast<size_t>(id)]) << id << " after " << num_taken;
    }
    EXPECT_EQ(second.steps.size(), static_cast<size_t>(kNum - num_taken)) << "what is repeated is known already";
    EXPECT_EQ(second.deltas, first.deltas);
    EXPECT_EQ(second.removed, first.removed);
  }
}

TEST(MapperSession, AStepOfAnotherKeyframeIsRefused) {
  Stack first(false), second(false);
  first.Keyframe(0);
  first.Keyframe(1);
  second.taken.assign(1, first.steps[1]);
  EXPECT_EQ(second.Keyframe(0), State::kFailed);
  EXPECT_THAT(second.failures, testing::ElementsAre(testing::HasSubstr("journal does not fit")));
}

TEST(MapperSession, AKeyframeWaitsForTheLoopResultsThatAreDueBeforeIt) {
  Stack stack;
  EXPECT_EQ(stack.Keyframe(0), State::kAwaitsKeyframe);
  EXPECT_EQ(stack.Keyframe(1), State::kAwaitsKeyframe);
  EXPECT_EQ(stack.Keyframe(2), State::kAwaitsCorrections) << "the result of keyframe 0 is due at keyframe 2";
  EXPECT_EQ(stack.Keyframe(3), State::kAwaitsCorrections);
  EXPECT_EQ(stack.session.num_waiting(), 2U);
  EXPECT_EQ(stack.NoLoopAt(1), State::kAwaitsCorrections);
  EXPECT_EQ(stack.NoLoopAt(0), State::kAwaitsKeyframe);
  EXPECT_EQ(stack.deltas.size(), 4U);
}

TEST(MapperSession, TheEndWaitsForAllLoopResults) {
  Stack stack;
  stack.Keyframe(0);
  EXPECT_EQ(stack.End(2), State::kAwaitsKeyframe) << "the tracker sent two keyframes";
  EXPECT_EQ(stack.Keyframe(1), State::kAwaitsCorrections);
  EXPECT_EQ(stack.NoLoopAt(0), State::kAwaitsCorrections);
  EXPECT_FALSE(stack.has_finished);
  EXPECT_EQ(stack.NoLoopAt(1), State::kFinished);
  EXPECT_TRUE(stack.has_finished);
  ASSERT_EQ(stack.ends.size(), 1U);
  EXPECT_EQ(stack.ends.front().stage, StageKind::kMapper);
  EXPECT_EQ(stack.ends.front().num_frames, 100);
  EXPECT_EQ(stack.ends.front().num_values, 2) << "deltas";
}

TEST(MapperSession, WithoutLoopClosingNothingIsWaitedFor) {
  Stack stack(false);
  for (int64_t id = 0; id < 4; ++id) stack.Keyframe(id);
  EXPECT_EQ(stack.End(4), State::kFinished);
}

TEST(MapperSession, APolishedMapIsFinalWhenTheAdjustmentHasCome) {
  for (const bool closes_loops : {false, true}) {
    Stack stack(closes_loops, true);
    for (int64_t id = 0; id < 4; ++id) {
      stack.Keyframe(id);
      if (closes_loops) stack.NoLoopAt(id);
    }
    EXPECT_EQ(stack.End(4), State::kAwaitsCorrections);
    ASSERT_EQ(stack.deltas, (std::vector<int64_t>{0, 1, 2, 3, 4})) << "the last one asks for it";
    GlobalAdjustment adjustment;
    adjustment.answers = {3};
    adjustment.delta = 4;
    adjustment.is_usable = true;
    EXPECT_EQ(stack.Receive(adjustment), State::kFinished);
    EXPECT_EQ(stack.ends.front().num_values, 6) << "deltas";
  }
}

TEST(MapperSession, ARunWithoutKeyframesEnds) {
  for (const bool polishes : {false, true}) {
    Stack stack(true, polishes);
    EXPECT_EQ(stack.End(0), State::kFinished);
    EXPECT_EQ(stack.ends.front().num_values, 0);
  }
}

TEST(MapperSession, AMissingKeyframeIsFatal) {
  Stack lost;
  lost.Keyframe(0);
  EXPECT_EQ(lost.Keyframe(2), State::kFailed);
  ASSERT_EQ(lost.failures.size(), 1U);
  EXPECT_NE(lost.failures.front().find("keyframe 2 came where 1 was expected"), std::string::npos);
  EXPECT_TRUE(lost.session.Advance().empty());

  Stack too_late;
  too_late.Keyframe(7);
  ASSERT_EQ(too_late.failures.size(), 1U);
  EXPECT_NE(too_late.failures.front().find("keeps no keyframes before keyframe 7"), std::string::npos);
}

TEST(MapperSession, ALoadedMapContinuesWithItsNextKeyframe) {
  Stack before(false);
  for (int64_t id = 0; id < 3; ++id) before.Keyframe(id);
  Stack stack;
  const auto loaded = stack.session.Load(before.session.map().Snapshot());
  ASSERT_TRUE(loaded);
  stack.Note(*loaded);
  EXPECT_EQ(stack.removed, std::vector<int64_t>{2}) << "what left the map before is not known, and not missing";
  EXPECT_EQ(stack.Keyframe(3), State::kAwaitsKeyframe);
  EXPECT_EQ(stack.deltas, std::vector<int64_t>{3});
}

TEST(MapperSession, ADamagedMapIsRefused) {
  Stack before(false);
  before.Keyframe(0);
  MapDelta snapshot = before.session.map().Snapshot();
  snapshot.hash += 1;
  Stack stack;
  EXPECT_FALSE(stack.session.Load(snapshot));
}

TEST(MapperSession, WhoLacksSomethingIsAnsweredAtOnce) {
  Stack stack;
  stack.Keyframe(0);
  stack.Keyframe(1);
  stack.Keyframe(2);
  ASSERT_EQ(stack.session.state(), State::kAwaitsCorrections);
  stack.deltas.clear();
  stack.Receive(MapRequest{.next_delta = 1});
  EXPECT_EQ(stack.deltas, std::vector<int64_t>{1});
  stack.Receive(MapRequest{});
  EXPECT_EQ(stack.pages, std::vector<int32_t>{0});
}

TEST(MapperSession, DelaysMustBePossible) {
  EXPECT_THROW(MapperSession({.delays = {.loop_keyframes = 0}}), std::invalid_argument);
  EXPECT_THROW(MapperSession({.delays = {.loop_keyframes = MapArchive::kDelay}}), std::invalid_argument);
  EXPECT_THROW(MapperSession({.delays = {.adjustment_growth = 0}}), std::invalid_argument);
}

}  // namespace
}  // namespace tessera
