#include "distribution/work_queue.h"

#include <gtest/gtest.h>

#include <random>

#include "support/synthetic_images.h"

namespace tessera {
namespace {

constexpr int64_t kSecondUs = 1'000'000;
const CameraCalibration kCalibration{
    .width_px = 320, .height_px = 240, .fx_px = 300, .fy_px = 300, .cx_px = 160, .cy_px = 120};

WorkQueueOptions TwoByTwo() {
  WorkQueueOptions options;
  options.grid = {.lines = 2, .columns = 2};
  return options;
}

CameraFrame Frame(int64_t id) {
  CameraFrame frame;
  frame.id = {id};
  frame.left = RectanglesImage(320, 240, 1);
  return frame;
}

struct Given {
  int extractor;
  FrameId frame;
  FrameId previous;
  int32_t tile;
  int32_t num_tiles;
};

std::vector<Given> GiveAll(WorkQueue& queue, int64_t now_us) {
  std::vector<Given> all;
  while (queue.CanGive()) {
    const auto [extractor, job] = queue.GiveNext(now_us);
    all.push_back({extractor, job->frame, job->previous_frame, job->tile, job->num_tiles});
  }
  return all;
}

TEST(WorkQueue, GivesEveryJobOfAFrameOnceAndSharesThemOut) {
  WorkQueue queue(TwoByTwo());
  ASSERT_TRUE(queue.AddFrame(Frame(0), kCalibration, 0));
  EXPECT_FALSE(queue.CanGive()) << "nobody to give to";
  queue.HearExtractor(0, 1, 0);
  queue.HearExtractor(1, 1, 0);
  std::set<int32_t> tiles;
  std::set<int> extractors;
  int num_tiles = -1;
  while (!queue.idle()) {
    const std::vector<Given> given = GiveAll(queue, 0);
    ASSERT_FALSE(given.empty());
    EXPECT_LE(given.size(), 4U) << "two jobs per extractor";
    for (const Given& job : given) {
      EXPECT_TRUE(tiles.insert(job.tile).second) << "given twice";
      extractors.insert(job.extractor);
      num_tiles = job.num_tiles;
      queue.Acknowledge(job.frame, {job.tile});
    }
  }
  EXPECT_EQ(static_cast<int>(tiles.size()), num_tiles);
  EXPECT_EQ(extractors.size(), 2U);
  EXPECT_EQ(queue.num_given_again(), 0);
}

TEST(WorkQueue, GivesTheJobsOfADeadExtractorToAnother) {
  WorkQueue queue(TwoByTwo());
  queue.AddFrame(Frame(0), kCalibration, 0);
  queue.HearExtractor(0, 1, 0);
  const std::vector<Given> first = GiveAll(queue, 0);
  ASSERT_EQ(first.size(), 2U);
  queue.HearExtractor(1, 1, 2 * kSecondUs);
  queue.CheckExtractors(2 * kSecondUs);  // extractor 0 has been silent for two seconds
  EXPECT_EQ(queue.num_extractors(), 1);
  const std::vector<Given> second = GiveAll(queue, 2 * kSecondUs);
  ASSERT_EQ(second.size(), 2U);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(second[i].extractor, 1);
    EXPECT_EQ(second[i].tile, first[i].tile) << "the oldest work comes first";
  }
}

TEST(WorkQueue, AsksForNoCandidatesFarBelowThoseChosenBeforeUnlessTheyAreWanted) {
  WorkQueue queue(TwoByTwo());
  queue.HearExtractor(0, 1, 0);
  queue.AddFrame(Frame(0), kCalibration, 0);
  EXPECT_TRUE(queue.GiveNext(0).job->min_priority.empty()) << "nothing is known yet";
  queue.SetLowestPriority({400, 40, 4, 0, 0, 0, 0, 0});
  queue.MarkTracked({0});
  queue.AddFrame(Frame(1), kCalibration, 0);
  const int32_t tile = queue.GiveNext(0).job->tile;
  const int32_t other = queue.GiveNext(0).job->tile;
  queue.Acknowledge({1}, {tile});
  queue.WantAll({1}, {tile});
  EXPECT_EQ(queue.num_wanted_whole(), 1);
  const WorkQueue::Assignment again = queue.GiveNext(0);
  EXPECT_EQ(again.job->tile, tile) << "before all that waits";
  EXPECT_TRUE(again.job->min_priority.empty());
  queue.WantAll({1}, {tile});
  EXPECT_EQ(queue.num_wanted_whole(), 1) << "they are on their way";
  queue.Acknowledge({1}, {tile, other});
  const std::vector<int32_t> guess = queue.GiveNext(0).job->min_priority;
  ASSERT_EQ(guess.size(), 8U);
  EXPECT_GT(guess[0], 100);
  EXPECT_LT(guess[0], 400);
  EXPECT_EQ(guess[7], 0);
}

TEST(WorkQueue, WholeImagesAreAskedForAll) {
  WorkQueue queue({});
  queue.HearExtractor(0, 1, 0);
  queue.SetLowestPriority({400, 40, 4, 0, 0, 0, 0, 0});
  queue.AddFrame(Frame(0), kCalibration, 0);
  EXPECT_TRUE(queue.GiveNext(0).job->min_priority.empty()) << "the extractor chooses itself";
}

TEST(WorkQueue, ARestartedExtractorGetsItsJobsAgain) {
  WorkQueue queue(TwoByTwo());
  queue.AddFrame(Frame(0), kCalibration, 0);
  queue.HearExtractor(0, 1, 0);
  const std::vector<Given> first = GiveAll(queue, 0);
  queue.HearExtractor(0, 2, 1000);
  const std::vector<Given> second = GiveAll(queue, 1000);
  ASSERT_EQ(second.size(), first.size());
  EXPECT_EQ(second[0].tile, first[0].tile);
}

TEST(WorkQueue, LateJobsGoToSomebodyElse) {
  WorkQueue queue(TwoByTwo());
  queue.AddFrame(Frame(0), kCalibration, 0);
  queue.HearExtractor(0, 1, 0);
  const std::vector<Given> first = GiveAll(queue, 0);
  queue.HearExtractor(0, 1, 3 * kSecondUs);
  queue.HearExtractor(1, 1, 3 * kSecondUs);
  queue.CheckExtractors(3 * kSecondUs);
  const std::vector<Given> second = GiveAll(queue, 3 * kSecondUs);
  ASSERT_GE(second.size(), 2U);
  EXPECT_EQ(second[0].tile, first[0].tile);
  EXPECT_EQ(second[0].extractor, 1);
  // The late answer of the first counts all the same.
  for (const Given& job : first) queue.Acknowledge(job.frame, {job.tile});
  for (const Given& job : second) queue.Acknowledge(job.frame, {job.tile});
  for (const Given& job : GiveAll(queue, 3 * kSecondUs)) queue.Acknowledge(job.frame, {job.tile});
  EXPECT_TRUE(queue.idle());
}

TEST(WorkQueue, AnExtractorThatWorksForSeveralRobotsIsGivenMoreTime) {
  WorkQueue queue(TwoByTwo());
  queue.AddFrame(Frame(0), kCalibration, 0);
  queue.HearExtractor(0, 1, 0, 3);
  GiveAll(queue, 0);
  queue.HearExtractor(1, 1, 5 * kSecondUs);
  queue.HearExtractor(0, 1, 5 * kSecondUs, 3);
  queue.CheckExtractors(5 * kSecondUs);
  EXPECT_EQ(queue.num_given_again(), 0);
  queue.HearExtractor(0, 1, 7 * kSecondUs, 3);
  queue.CheckExtractors(7 * kSecondUs);
  EXPECT_EQ(queue.num_given_again(), 2);
}

TEST(WorkQueue, BoundsFramesInFlightAndDropsWhenFull) {
  WorkQueueOptions options;
  options.max_frames_in_flight = 2;
  options.max_queued_frames = 3;
  options.jobs_per_extractor = 10;
  WorkQueue queue(options);
  queue.HearExtractor(0, 1, 0);
  std::vector<int64_t> kept;
  for (int64_t id = 0; id < 8; ++id) {
    if (queue.AddFrame(Frame(id), kCalibration, 0)) kept.push_back(id);
    for (const Given& job : GiveAll(queue, 0)) queue.Acknowledge(job.frame, {job.tile});
  }
  EXPECT_EQ(kept, (std::vector<int64_t>{0, 1, 2, 3, 4}));
  queue.MarkTracked({1});
  const std::vector<Given> next = GiveAll(queue, 0);
  ASSERT_EQ(next.size(), 2U);
  EXPECT_EQ(next[0].frame.value, 2);
  EXPECT_EQ(next[0].previous.value, 1);
  ASSERT_TRUE(queue.AddFrame(Frame(9), kCalibration, 0));
  queue.MarkTracked({3});
  const std::vector<Given> last = GiveAll(queue, 0);
  ASSERT_EQ(last.size(), 2U);
  EXPECT_EQ(last[1].frame.value, 9);
  EXPECT_EQ(last[1].previous.value, 4) << "dropped frames are not waited for";
}

TEST(WorkQueue, GivesAllOfWhatIsNotTrackedAgainToANewReassembler) {
  WorkQueueOptions options;
  options.jobs_per_extractor = 10;
  WorkQueue queue(options);
  queue.HearExtractor(0, 1, 0);
  for (int64_t id = 0; id < 3; ++id) ASSERT_TRUE(queue.AddFrame(Frame(id), kCalibration, 0));
  std::vector<Given> first = GiveAll(queue, 0);
  ASSERT_EQ(first.size(), 3U);
  for (const int64_t id : {0, 1}) queue.Acknowledge({id}, {0});
  queue.MarkTracked({0});
  EXPECT_FALSE(queue.CanGive());
  queue.GiveAllAgain();
  const std::vector<Given> second = GiveAll(queue, 0);
  ASSERT_EQ(second.size(), 2U);
  EXPECT_EQ(second[0].frame.value, 1);
  EXPECT_EQ(second[0].previous.value, 0);
  EXPECT_EQ(second[1].frame.value, 2);
  queue.Acknowledge({1}, {0});
  EXPECT_FALSE(queue.idle());
  queue.MarkTracked({2});  // what its first reassembler released is done
  EXPECT_TRUE(queue.idle());
}

TEST(WorkQueue, ANewQueueGoesOnBehindWhatIsTracked) {
  WorkQueueOptions options;
  options.max_queued_frames = 2;
  WorkQueue queue(options);
  for (int64_t id = 0; id < 6; ++id) EXPECT_TRUE(queue.AddFrame(Frame(id), kCalibration, 0, true));
  EXPECT_FALSE(queue.AddFrame(Frame(6), kCalibration, 0));
  queue.MarkTracked({5});
  EXPECT_TRUE(queue.idle());
  queue.SkipFrame({6});
  ASSERT_TRUE(queue.AddFrame(Frame(7), kCalibration, 0));
  queue.HearExtractor(0, 1, 0);
  const std::vector<Given> given = GiveAll(queue, 0);
  ASSERT_EQ(given.size(), 1U);
  EXPECT_EQ(given[0].previous.value, 6);
}

// Extractors that die, restart, answer late or never: all the work gets done in the end.
TEST(WorkQueue, FinishesWhateverHappensToExtractors) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 generator(seed);
    WorkQueue queue(TwoByTwo());
    std::vector<Given> unanswered;
    int64_t next_frame = 0;
    int64_t now_us = 0;
    std::map<int, int64_t> epochs;
    while (next_frame < 12 || !queue.idle()) {
      ASSERT_LT(now_us, 1000 * kSecondUs) << "no progress, seed " << seed;
      now_us += 100'000;
      if (next_frame < 12 && queue.AddFrame(Frame(next_frame), kCalibration, 0)) ++next_frame;
      for (int extractor = 0; extractor < 3; ++extractor) {
        if (generator() % 20 == 0) ++epochs[extractor];                                       // restarts
        if (generator() % 8 != 0) queue.HearExtractor(extractor, epochs[extractor], now_us);  // else silent
      }
      queue.CheckExtractors(now_us);
      for (const Given& job : GiveAll(queue, now_us)) unanswered.push_back(job);
      std::shuffle(unanswered.begin(), unanswered.end(), generator);
      while (!unanswered.empty() && generator() % 3 != 0) {
        const Given job = unanswered.back();
        unanswered.pop_back();
        if (generator() % 5 == 0) continue;  // died with its extractor
        queue.Acknowledge(job.frame, {job.tile});
      }
      queue.MarkTracked({next_frame - 4});
    }
  }
}

}  // namespace
}  // namespace tessera
