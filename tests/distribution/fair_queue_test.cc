#include "distribution/fair_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace tessera {
namespace {

TileJob Job(int64_t frame) {
  TileJob job;
  job.frame = {frame};
  return job;
}

// Serves until `num_turns` jobs are done; robot i always has `waiting[i]` jobs of `work[i]` waiting. Returns the work
// done for each.
std::vector<int64_t> Serve(FairQueue& queue, const std::vector<int64_t>& work, const std::vector<size_t>& waiting,
                           int num_turns) {
  std::vector<int64_t> done(work.size());
  for (int turn = 0; turn < num_turns; ++turn) {
    for (size_t robot = 0; robot < work.size(); ++robot) {
      while (queue.num_waiting(robot) < waiting[robot]) queue.Push(robot, work[robot], Job(0));
    }
    const FairQueue::Turn next = queue.Pop();
    done[next.robot] += next.work;
  }
  return done;
}

TEST(FairQueue, KeepsTheOrderOfOneRobot) {
  FairQueue queue(1);
  for (int64_t frame = 0; frame < 10; ++frame) ASSERT_TRUE(queue.Push(0, 1 + frame % 3, Job(frame)));
  for (int64_t frame = 0; frame < 10; ++frame) EXPECT_EQ(queue.Pop().job.frame.value, frame);
  EXPECT_TRUE(queue.empty());
}

TEST(FairQueue, SharesByWorkNotByJobs) {
  FairQueue queue(2);
  const std::vector<int64_t> done = Serve(queue, {100, 7}, {2, 2}, 2000);
  EXPECT_LE(std::abs(done[0] - done[1]), 107);
}

TEST(FairQueue, ARobotThatFloodsGetsNoMore) {
  FairQueue queue(3);
  const std::vector<int64_t> done = Serve(queue, {10, 10, 10}, {FairQueue::kMaxWaiting, 1, 2}, 3000);
  EXPECT_LE(*std::max_element(done.begin(), done.end()) - *std::min_element(done.begin(), done.end()), 20);
}

TEST(FairQueue, NobodyIsPaidForHavingBeenIdle) {
  FairQueue queue(2);
  Serve(queue, {10, 10}, {2, 0}, 1000);  // robot 1 has nothing to do
  const std::vector<int64_t> done = Serve(queue, {10, 10}, {2, 2}, 20);
  EXPECT_LE(std::abs(done[0] - done[1]), 20);
}

TEST(FairQueue, NobodyPaysForHavingBeenAlone) {
  FairQueue queue(2);
  Serve(queue, {10, 10}, {2, 0}, 1000);
  queue.Drop(0);
  Serve(queue, {10, 10}, {0, 2}, 10);  // the other one alone, for less long
  const std::vector<int64_t> done = Serve(queue, {10, 10}, {2, 2}, 40);
  EXPECT_LE(std::abs(done[0] - done[1]), 20) << "the past of one is no debt";
}

TEST(FairQueue, TheFirstJobOfANewcomerIsNextButOneAtMost) {
  FairQueue queue(3);
  Serve(queue, {50, 50, 1}, {40, 40, 0}, 500);
  queue.Push(2, 1000, Job(7));
  int num_before = 0;
  while (queue.Pop().robot != 2) ++num_before;
  EXPECT_LE(num_before, 2) << "one of each of the others";
}

TEST(FairQueue, BoundsAndDropsWhatWaits) {
  FairQueue queue(2);
  for (size_t i = 0; i < FairQueue::kMaxWaiting; ++i) ASSERT_TRUE(queue.Push(0, 1, Job(0)));
  EXPECT_FALSE(queue.Push(0, 1, Job(0)));
  EXPECT_TRUE(queue.Push(1, 1, Job(5))) << "that is the first robot's affair";
  queue.Drop(0);
  EXPECT_EQ(queue.num_waiting(0), 0U);
  EXPECT_EQ(queue.Pop().job.frame.value, 5);
  EXPECT_TRUE(queue.empty());
}

// Whatever comes when: while two robots both have jobs waiting, their shares differ by their largest jobs at most.
TEST(FairQueue, SharesAreEvenWheneverTwoHaveWork) {
  constexpr int64_t kMaxWork = 100;
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 generator(seed);
    FairQueue queue(3);
    std::vector<std::array<int64_t, 3>> done(1);  // work of each robot after each turn
    std::array<size_t, 3> busy_since{};           // the turn since which a robot always had a job waiting
    for (int turn = 0; turn < 400; ++turn) {
      for (size_t robot = 0; robot < 3; ++robot) {
        const size_t wish = generator() % 4 == 0 ? 0 : 2 + generator() % 4;
        if (queue.num_waiting(robot) == 0) busy_since[robot] = done.size() - 1;
        while (queue.num_waiting(robot) < wish) queue.Push(robot, 1 + generator() % kMaxWork, Job(0));
      }
      if (queue.empty()) continue;
      const FairQueue::Turn next = queue.Pop();
      done.push_back(done.back());
      done.back()[next.robot] += next.work;
      for (size_t a = 0; a < 3; ++a) {
        for (size_t b = 0; b < a; ++b) {
          if (queue.num_waiting(a) == 0 || queue.num_waiting(b) == 0) continue;
          const auto& before = done[std::max(busy_since[a], busy_since[b])];
          EXPECT_LE(std::abs((done.back()[a] - before[a]) - (done.back()[b] - before[b])), 2 * kMaxWork)
              << "seed " << seed << ", turn " << turn;
        }
      }
    }
  }
}

}  // namespace
}  // namespace tessera
