#include "evaluation/statistics.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(Summarize, KnowsTheFiguresOfOneToHundredAndOne) {
  std::vector<double> values;
  for (int i = 101; i >= 1; --i) {
    values.push_back(i);
  }
  const auto statistics = Summarize(values);
  ASSERT_TRUE(statistics);
  EXPECT_EQ(statistics->count, 101);
  EXPECT_DOUBLE_EQ(statistics->mean, 51.0);
  EXPECT_DOUBLE_EQ(statistics->median, 51.0);
  EXPECT_DOUBLE_EQ(statistics->p95, 96.0);
  EXPECT_DOUBLE_EQ(statistics->p99, 100.0);
  EXPECT_DOUBLE_EQ(statistics->max, 101.0);
}

TEST(Summarize, InterpolatesBetweenValues) {
  const auto statistics = Summarize({4.0, 1.0});
  EXPECT_DOUBLE_EQ(statistics->median, 2.5);
  EXPECT_DOUBLE_EQ(statistics->p95, 3.85);
}

TEST(Summarize, TakesOneValueAndNone) {
  EXPECT_DOUBLE_EQ(Summarize({7.0})->p99, 7.0);
  EXPECT_FALSE(Summarize({}));
}

}  // namespace
}  // namespace tessera
