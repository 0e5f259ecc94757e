#include "distribution/extractor_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/errors.h"
#include "features/tiling.h"
#include "messages/topics.h"

namespace tessera {
namespace {

using testing::ElementsAre;
using Taken = ExtractorSession::Taken;

TileJob Job(int64_t frame, int64_t run = 1) {
  TileJob job;
  job.run = run;
  job.frame = {frame};
  job.calibration.width_px = job.calibration.height_px = 64;
  job.calibration.fx_px = job.calibration.fy_px = 64.0;
  job.calibration.cx_px = job.calibration.cy_px = 32.0;
  job.core = job.left_rect = {0, 0, 64, 64};
  job.left.width = job.left.height = 64;
  job.left.pixels.assign(64 * 64, 7);
  return job;
}

// The robots whose jobs wait, in the order in which they are done.
std::vector<size_t> DoAll(ExtractorSession& session) {
  std::vector<size_t> robots;
  while (session.has_jobs()) {
    const FairQueue::Turn turn = session.TakeNext();
    session.Do(turn);
    robots.push_back(turn.robot);
  }
  return robots;
}

TEST(ParseRobots, TakesPrefixesBetweenCommas) {
  EXPECT_THAT(ParseRobots("", "own_"), ElementsAre());
  EXPECT_THAT(ParseRobots("a_,b_", "own_"), ElementsAre("a_", "b_"));
}

TEST(ParseRobots, RefusesWhatNamesNoRobotOrOneTwice) {
  for (const std::string text : {",", "a_,,b_", "a_,a_", "own_", "a_,own_"}) {
    EXPECT_THROW(ParseRobots(text, "own_"), InputError) << text;
  }
}

TEST(ParseRobots, RefusesMoreThanAnExtractorServes) {
  std::string text = "r0";
  for (int robot = 1; robot < kMaxRobots - 1; ++robot) text += ",r" + std::to_string(robot);
  EXPECT_EQ(ParseRobots(text, "").size(), static_cast<size_t>(kMaxRobots - 1)) << "and the own one";
  EXPECT_THROW(ParseRobots(text + ",more", ""), InputError);
}

TEST(ExtractorSession, AnswersAJobWithItsFrameAndTile) {
  ExtractorSession session(1);
  TileJob job = Job(3);
  job.tile = 1;
  job.num_tiles = 2;
  ASSERT_TRUE(session.Receive(0, job, 0));
  const FairQueue::Turn turn = session.TakeNext();
  const TileFeatures features = session.Do(turn);
  EXPECT_EQ(features.frame, FrameId{3});
  EXPECT_EQ(features.tile, 1);
  EXPECT_EQ(session.work_done(0), WorkOf(job));
  EXPECT_FALSE(session.has_jobs());
}

TEST(ExtractorSession, RefusesWhatMakesNoSense) {
  ExtractorSession session(1);
  TileJob job = Job(3);
  job.left.pixels.pop_back();
  const auto taken = session.Receive(0, job, 0);
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().sentence, testing::StartsWith("job for frame 3, tile 0 is refused: "));
  EXPECT_FALSE(session.has_jobs());
}

TEST(ExtractorSession, RefusesWhatWouldNeverGetItsTurn) {
  ExtractorSession session(2);
  for (size_t i = 0; i < FairQueue::kMaxWaiting; ++i) ASSERT_TRUE(session.Receive(0, Job(0), 0));
  EXPECT_FALSE(session.Receive(0, Job(0), 0));
  EXPECT_TRUE(session.Receive(1, Job(0), 0)) << "the other robot's share is its own";
}

TEST(ExtractorSession, ANewRunOfARobotDropsItsOldJobsOnly) {
  ExtractorSession session(2);
  EXPECT_EQ(session.Receive(0, Job(0), 0).value(), Taken::kOfNewRun) << "the first";
  EXPECT_EQ(session.Receive(0, Job(1), 0).value(), Taken::kAsBefore);
  EXPECT_TRUE(session.Receive(1, Job(0), 0));
  EXPECT_EQ(session.Receive(0, Job(0, 2), 0).value(), Taken::kOfNewRun);
  EXPECT_EQ(session.num_waiting(0), 1U);
  EXPECT_EQ(session.num_waiting(1), 1U);
  EXPECT_THAT(DoAll(session), testing::UnorderedElementsAre(0, 1));
}

TEST(ExtractorSession, SaysHowManyShareItOfLate) {
  ExtractorSession session(3);
  EXPECT_TRUE(session.is_pool());
  EXPECT_EQ(session.Ready(7, 5, 0).num_robots, 1) << "a newcomer would have it to itself";
  session.Receive(0, Job(0), 0).value();
  session.Receive(2, Job(0), 1).value();
  DoAll(session);
  const ExtractorReady ready = session.Ready(7, 5, 2);
  EXPECT_EQ(ready.extractor, 7);
  EXPECT_EQ(ready.epoch_us, 5);
  EXPECT_EQ(ready.num_jobs_done, 2);
  EXPECT_EQ(ready.num_robots, 2);
  EXPECT_EQ(session.Ready(7, 5, ExtractorSession::kRecentUs).num_robots, 1);
}

}  // namespace
}  // namespace tessera
