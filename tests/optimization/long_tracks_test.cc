// Landmarks that very many keyframes see, taken apart.
#include "optimization/long_tracks.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <vector>

namespace tessera {
namespace {

constexpr int kNumPoses = 100;

// Two drives along a straight road, 50 keyframes each, a meter apart. All of them see the point at its end; the one
// beside its begin is seen by the first ten.
BundleProblem TwoDrives() {
  BundleProblem problem;
  for (int k = 0; k < kNumPoses; ++k) {
    BundlePose pose;
    pose.id = {k};
    pose.camera_from_world.translation = {0.0, 0.0, -1.0 * (k % 50)};
    problem.poses.push_back(pose);
  }
  problem.points.push_back({{7}, {0.0, 0.0, 60.0}});
  problem.points.push_back({{8}, {1.0, 0.0, 12.0}});
  for (int k = 0; k < kNumPoses; ++k) {
    problem.observations.push_back({k, 0, {}});
    if (k < 10) problem.observations.push_back({k, 1, {}});
  }
  return problem;
}

TEST(SplitLongTracks, KeyframesAtTheSameDistanceKeepTheirCommonPoint) {
  const BundleProblem before = TwoDrives();
  BundleProblem after = before;
  SplitLongTracks(40, after);
  ASSERT_EQ(after.points.size(), 4U) << "a hundred observers in three groups";
  ASSERT_EQ(after.observations.size(), before.observations.size());
  std::map<int, std::set<int>> places;  // by point: how far along the road its observers stand
  std::map<int, int> num_observers;
  for (size_t i = 0; i < after.observations.size(); ++i) {
    EXPECT_EQ(after.observations[i].pose, before.observations[i].pose);
    places[after.observations[i].point].insert(after.observations[i].pose % 50);
    ++num_observers[after.observations[i].point];
  }
  EXPECT_EQ(num_observers[1], 10) << "of few observers: as it was";
  for (const int point : {0, 2, 3}) {
    const auto index = static_cast<size_t>(point);
    EXPECT_LE(num_observers[point], 40);
    EXPECT_EQ(after.points[index].id, LandmarkId{7});
    EXPECT_EQ(after.points[index].position_in_world, before.points[0].position_in_world);
    EXPECT_LE(*places[point].rbegin() - *places[point].begin(), 17) << "a third of the road, in both drives";
    EXPECT_GE(num_observers[point], 2 * static_cast<int>(places[point].size()) - 1);
  }
  EXPECT_EQ(*places[0].rbegin(), 49) << "the nearest keep the point";
}

TEST(SplitLongTracks, WhatIsSeenByFewStaysAsItIs) {
  BundleProblem problem = TwoDrives();
  SplitLongTracks(kNumPoses, problem);
  EXPECT_EQ(problem.points.size(), 2U);
  for (const BundleObservation& observation : problem.observations) EXPECT_LT(observation.point, 2);
}

}  // namespace
}  // namespace tessera
