#include "loop_closing/loop_closer_session.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "support/synthetic_world.h"

namespace tessera {
namespace {

using State = LoopCloserSession::State;

// A drive of some keyframes, of which the session has seen none, and a session that follows it.
class LoopCloserSessionTest : public testing::Test {
 protected:
  LoopCloserSessionTest() {
    for (int64_t step = 0; step < 4; ++step) planted_.Add(step, {step - 1});
  }
  static LoopCloserSession MakeSession(bool closes_loops = true) {
    static const auto vocabulary = Vocabulary::Load(TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
    return {vocabulary, {.closes_loops = closes_loops}};
  }
  const MapDelta& Delta(size_t number) const { return planted_.deltas().at(number); }
  RelocalizationRequest Question(int64_t frame, int64_t last_keyframe) {
    RelocalizationRequest request{world_.Take(1).features, {last_keyframe}};
    request.features.frame = {frame};
    return request;
  }

  SyntheticWorld world_{SensorType::kStereo, 0.3};
  PlantedMap planted_{world_};
};

TEST_F(LoopCloserSessionTest, EachKeyframeGetsOneResult) {
  LoopCloserSession session = MakeSession();
  for (size_t number = 0; number < 4; ++number) {
    ASSERT_TRUE(session.Receive(Delta(number)));
    ASSERT_EQ(session.state(), State::kMustFindLoop);
    const auto outcome = session.Advance();
    ASSERT_TRUE(std::holds_alternative<LoopResult>(outcome));
    EXPECT_EQ(std::get<LoopResult>(outcome).answers, Delta(number).answers);
    EXPECT_EQ(session.state(), State::kIdle);
  }
  EXPECT_TRUE(std::holds_alternative<std::monostate>(session.Advance()));
}

TEST_F(LoopCloserSessionTest, ADeltaWithoutANewKeyframeGetsNone) {
  LoopCloserSession session = MakeSession();
  ASSERT_TRUE(session.Receive(planted_.map().Snapshot()));
  EXPECT_EQ(session.state(), State::kMustFindLoop) << "nobody knows whether the last keyframe got its result";
  (void)session.Advance();
  MapDelta empty;  // as at the end of a run
  empty.number = planted_.map().next_delta();
  empty.answers = planted_.map().answered();
  empty.hash = planted_.map().hash();
  ASSERT_TRUE(session.Receive(empty));
  EXPECT_EQ(session.state(), State::kIdle);
}

TEST_F(LoopCloserSessionTest, WithoutLoopClosingNothingIsLookedFor) {
  LoopCloserSession session = MakeSession(false);
  ASSERT_TRUE(session.Receive(Delta(0)));
  EXPECT_EQ(session.state(), State::kIdle);
}

TEST_F(LoopCloserSessionTest, AQuestionWaitsForTheMapThatItIsAbout) {
  LoopCloserSession session = MakeSession(false);
  session.Receive(Question(40, 2));
  EXPECT_EQ(session.state(), State::kIdle) << "there is no map";
  ASSERT_TRUE(session.Receive(Delta(0)));
  ASSERT_TRUE(session.Receive(Delta(1)));
  EXPECT_EQ(session.state(), State::kIdle);
  ASSERT_TRUE(session.Receive(Delta(2)));
  ASSERT_EQ(session.state(), State::kMustAnswer);
  const auto outcome = session.Advance();
  ASSERT_TRUE(std::holds_alternative<RelocalizationAnswer>(outcome));
  EXPECT_EQ(std::get<RelocalizationAnswer>(outcome).frame, FrameId{40});
  EXPECT_EQ(session.state(), State::kIdle);
  EXPECT_EQ(session.counts().num_asked, 1);
}

TEST_F(LoopCloserSessionTest, NothingIsAnsweredOnAMapThatWentWrong) {
  LoopCloserSession session = MakeSession(false);
  ASSERT_TRUE(session.Receive(Delta(0)));
  MapDelta damaged = Delta(1);
  damaged.hash += 1;
  EXPECT_FALSE(session.Receive(damaged));
  session.Receive(Question(40, 0));
  EXPECT_EQ(session.state(), State::kIdle);
  ASSERT_TRUE(session.Receive(planted_.map().Snapshot()));
  EXPECT_EQ(session.state(), State::kMustAnswer);
}

}  // namespace
}  // namespace tessera
