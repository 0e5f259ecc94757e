#include "datasets/pose_track.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kMs = 1'000'000;

TEST(PoseTrack, InterpolatesBetweenNeighbors) {
  PoseTrack track;
  track.Add(10 * kMs, {ExpSO3({0.0, 0.0, 0.2}), {1.0, 0.0, 0.0}});
  track.Add(20 * kMs, {ExpSO3({0.0, 0.0, 0.4}), {3.0, 2.0, 0.0}});
  const auto pose = track.At(15 * kMs);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->translation - Eigen::Vector3d(2.0, 1.0, 0.0)).norm(), 1e-12);
  EXPECT_LT((LogSO3(pose->rotation) - Eigen::Vector3d(0.0, 0.0, 0.3)).norm(), 1e-12);
  EXPECT_EQ(track.At(20 * kMs)->translation, Eigen::Vector3d(3.0, 2.0, 0.0));
  EXPECT_EQ(track.At(10 * kMs)->translation, Eigen::Vector3d(1.0, 0.0, 0.0));
}

TEST(PoseTrack, KnowsNothingOutsideAndInGaps) {
  PoseTrack track;
  EXPECT_FALSE(track.At(0));
  track.Add(10 * kMs, {});
  track.Add(20 * kMs, {});
  track.Add(20 * kMs + PoseTrack::kMaxGapNs + 1, {});
  EXPECT_FALSE(track.At(9 * kMs));
  EXPECT_FALSE(track.At(30 * kMs));
  EXPECT_FALSE(track.At(500 * kMs));
  EXPECT_TRUE(track.At(20 * kMs + PoseTrack::kMaxGapNs + 1));
}

}  // namespace
}  // namespace tessera
