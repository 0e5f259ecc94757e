#include "evaluation/evaluator_session.h"

#include <gtest/gtest.h>

#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr int64_t kSecond = 1'000'000;

// A run of two frames and one delta.
struct Evaluator {
  void SendPoses() {
    for (int64_t frame = 0; frame < 2; ++frame) {
      EXPECT_THAT(session.Receive(PoseEstimate{.frame = {frame}, .state = TrackingState::kTracked}, 7, kSecond),
                  IsSuccess());
    }
  }
  void SendMap() {
    EXPECT_THAT(session.Receive(WithHash(Map(), {.new_keyframes = {{{0}, {}, {}, PlainFeatures(0, 3)}}})), IsSuccess());
    session.NoteMap(false, kSecond);
    session.Receive(RemovedInDelta{.delta = 0});
  }
  void SendEnds() {
    EXPECT_THAT(session.Receive(EndOfStream{StageKind::kTracker, 2, 1}, kSecond), IsSuccess());
    EXPECT_THAT(session.Receive(EndOfStream{.stage = StageKind::kMapper, .num_values = 1}, kSecond), IsSuccess());
  }

  EvaluatorSession session{"evaluator", false};
};

TEST(EvaluatorSession, WritesOnceWhenAllIsThere) {
  Evaluator evaluator;
  evaluator.SendPoses();
  evaluator.SendEnds();
  EXPECT_FALSE(evaluator.session.MustWrite(kSecond)) << "the map is missing";
  evaluator.SendMap();
  ASSERT_TRUE(evaluator.session.MustWrite(kSecond));
  const RunRecord& record = evaluator.session.TakeRecord();
  EXPECT_EQ(record.Counts().tracked, 2);
  EXPECT_EQ(record.Counts().dropped, 1);
  EXPECT_EQ(record.Keyframes().size(), 1U);
  EXPECT_FALSE(evaluator.session.MustWrite(kSecond));
  EXPECT_FALSE(evaluator.session.MayWrite());
}

TEST(EvaluatorSession, WaitsForTheColorsOfKeyframesForAWhile) {
  for (const bool comes : {true, false}) {
    Evaluator evaluator{EvaluatorSession{"evaluator", /*with_color=*/true}};
    evaluator.SendPoses();
    EXPECT_THAT(evaluator.session.Receive(PoseEstimate{.frame = {2}, .is_keyframe = true}, 7, kSecond), IsSuccess());
    evaluator.SendMap();
    EXPECT_THAT(evaluator.session.Receive(EndOfStream{StageKind::kTracker, 3, 0}, kSecond), IsSuccess());
    EXPECT_THAT(evaluator.session.Receive(EndOfStream{.stage = StageKind::kMapper, .num_values = 1}, kSecond),
                IsSuccess());
    EXPECT_FALSE(evaluator.session.MustWrite(kSecond));
    if (comes) evaluator.session.Receive(ColorFrame{.id = {2}});
    EXPECT_EQ(evaluator.session.MustWrite(2 * kSecond), comes);
    EXPECT_EQ(evaluator.session.MustWrite(kSecond + EvaluatorSession::kMaxWaitForColorsUs), true);
  }
}

TEST(EvaluatorSession, AFrameFarBeyondAllOthersIsNoneOfTheSource) {
  Evaluator evaluator;
  EXPECT_FALSE(evaluator.session.Receive(PoseEstimate{.frame = {2'000'000'000}}, 7, kSecond).has_value());
  evaluator.SendPoses();
  EXPECT_FALSE(evaluator.session.Receive(PoseEstimate{.frame = {2'000'000'000}}, 7, kSecond).has_value());
  EXPECT_THAT(evaluator.session.Receive(PoseEstimate{.frame = {108'000}}, 7, kSecond), IsSuccess()) << "an hour later";
  EXPECT_EQ(evaluator.session.TakeRecord().Frames().size(), 3U);
}

TEST(EvaluatorSession, AnEndBeforeFramesThatHavePosesIsNone) {
  Evaluator evaluator;
  evaluator.SendPoses();
  evaluator.SendMap();
  for (const StageKind stage : {StageKind::kTracker, StageKind::kCamera}) {
    EXPECT_FALSE(evaluator.session.Receive(EndOfStream{.stage = stage, .num_frames = 1}, kSecond).has_value());
  }
  EXPECT_FALSE(evaluator.session.MustWrite(kSecond));
  evaluator.SendEnds();
  EXPECT_TRUE(evaluator.session.MustWrite(kSecond));
}

TEST(EvaluatorSession, TellsOfFramesThatNobodyAccountsFor) {
  Evaluator evaluator;
  evaluator.SendPoses();
  evaluator.SendMap();
  EXPECT_THAT(evaluator.session.Receive(EndOfStream{.stage = StageKind::kCamera, .num_frames = 60}, kSecond),
              IsSuccess());
  evaluator.SendEnds();
  ASSERT_TRUE(evaluator.session.MustWrite(kSecond));
  EXPECT_EQ(evaluator.session.TakeRecord().Counts().missing, 57) << "two have poses, and one is known to be dropped";
}

TEST(EvaluatorSession, AReplicaThatHasToBeReplacedIsWaitedFor) {
  Evaluator evaluator;
  evaluator.SendPoses();
  evaluator.SendMap();
  evaluator.SendEnds();
  evaluator.session.NoteMap(true, kSecond);
  EXPECT_FALSE(evaluator.session.MustWrite(kSecond));
  evaluator.session.NoteMap(false, kSecond);
  EXPECT_TRUE(evaluator.session.MustWrite(kSecond));
}

TEST(EvaluatorSession, ToldToStopItWritesWhatThereIs) {
  Evaluator evaluator;
  EXPECT_FALSE(evaluator.session.MayWrite()) << "the run never began";
  evaluator.SendPoses();
  EXPECT_TRUE(evaluator.session.MayWrite());

  Evaluator without_poses;
  without_poses.SendEnds();
  EXPECT_TRUE(without_poses.session.MayWrite());
}

TEST(EvaluatorSession, ADeltaThatDoesNotFitIsRefused) {
  Evaluator evaluator;
  MapDelta delta = WithHash(Map(), {.new_keyframes = {{{0}, {}, {}, PlainFeatures(0, 3)}}});
  delta.number = 5;
  EXPECT_THAT(evaluator.session.Receive(delta), IsFailure(testing::_));
}

TEST(EvaluatorSession, RecordsTheLatestFiguresOfEachStage) {
  Evaluator evaluator;
  evaluator.session.Receive(StageStatus{.name = "mapper", .num_lost = 1}, 0);
  evaluator.session.Receive(
      StageStatus{.name = "mapper",
                  .num_dropped = 2,
                  .num_repaired = 3,
                  .num_lost = 4,
                  .step = {.count = 5, .mean_ms = 1, .median_ms = 2, .p95_ms = 3, .p99_ms = 4, .max_ms = 6},
                  .values = {{"keyframes", 7}}},
      1);
  const std::map<std::string, StageRecord>& stages = evaluator.session.TakeRecord().stages();
  ASSERT_EQ(stages.size(), 1U);
  const StageRecord& mapper = stages.at("mapper");
  EXPECT_EQ(mapper.num_dropped, 2);
  EXPECT_EQ(mapper.num_repaired, 3);
  EXPECT_EQ(mapper.num_lost, 4);
  EXPECT_EQ(mapper.step_ms.count, 5);
  EXPECT_EQ(mapper.step_ms.median, 2);
  EXPECT_EQ(mapper.step_ms.p95, 3);
  EXPECT_EQ(mapper.step_ms.max, 6);
  EXPECT_EQ(mapper.values.at("keyframes"), 7);
}

}  // namespace
}  // namespace tessera
