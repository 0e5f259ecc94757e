// What a stage says of itself.
#include "runtime/stage_figures.h"

#include <gtest/gtest.h>

#include "core/version.h"

namespace tessera {
namespace {

StageIdentity Identity() { return {.name = "mapper", .epoch_us = 5, .host = "here", .pid = 7}; }

TEST(StageFigures, StatisticsAreOfAllSteps) {
  EXPECT_EQ(StatisticsOf({}).count, 0);
  std::vector<float> steps_ms;
  for (int i = 101; i >= 1; --i) steps_ms.push_back(static_cast<float>(i));
  const StepStatistics statistics = StatisticsOf(steps_ms);
  EXPECT_EQ(statistics.count, 101);
  EXPECT_NEAR(statistics.mean_ms, 51.0, 1e-9);
  EXPECT_EQ(statistics.median_ms, 51.0);
  EXPECT_DOUBLE_EQ(statistics.p95_ms, 96.0);
  EXPECT_DOUBLE_EQ(statistics.p99_ms, 100.0);
  EXPECT_EQ(statistics.max_ms, 101.0);
}

TEST(StageFigures, StatisticsAreComputedOnceASecondAndAtTheEnd) {
  StageFigures figures(Identity());
  figures.RecordStep(1.0);
  EXPECT_EQ(figures.MakeStatus(StageState::kRunning, {}, 0, 0, 2'000'000, false).step.count, 1);
  figures.RecordStep(2.0);
  EXPECT_EQ(figures.MakeStatus(StageState::kRunning, {}, 0, 0, 2'500'000, false).step.count, 1);
  EXPECT_EQ(figures.MakeStatus(StageState::kRunning, {}, 0, 0, 2'600'000, true).step.count, 2);
}

TEST(StageFigures, AStatusNamesItsProcess) {
  StageFigures figures(Identity());
  figures.SetValue("keyframes", 1);
  figures.SetValue("landmarks", 5);
  figures.SetValue("keyframes", 2);
  figures.last_error = std::string(1000, 'x');
  const StageStatus status =
      figures.MakeStatus(StageState::kRunning, {.num_repaired = 3, .num_lost = 4}, 5, 6, 1, false);
  EXPECT_EQ(status.name, "mapper");
  EXPECT_EQ(status.version, kVersion);
  EXPECT_EQ(status.num_repaired, 3);
  EXPECT_EQ(status.num_lost, 4);
  EXPECT_EQ(status.num_undecodable, 5);
  EXPECT_EQ(status.values, (std::vector<std::pair<std::string, double>>{{"keyframes", 2}, {"landmarks", 5}}));
  EXPECT_EQ(status.last_error.size(), 300U) << "a status must be one message";
}

}  // namespace
}  // namespace tessera
