// Points by two frames alone, on the synthetic world.
#include "tracking/pair_points.h"

#include <gtest/gtest.h>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// The frame, with only its first keypoints' points known.
TrackedFrame KnowsFirst(TrackedFrame frame, size_t num_known) {
  for (size_t i = num_known; i < frame.points.size(); ++i) frame.points[i] = {};
  return frame;
}

class PairPoints : public testing::Test {
 protected:
  SyntheticWorld world_{SensorType::kMono, 0.3};
  const TrackedFrame all_ = world_.TrackedAt(2), all_other_ = world_.TrackedAt(0);
};

TEST_F(PairPoints, AreSeenByBothFramesAndKnownToNone) {
  const TrackedFrame frame = KnowsFirst(all_, 50), other = KnowsFirst(all_other_, 50);
  const std::vector<PairPoint> points = FindPairPoints(frame, other);
  ASSERT_GT(points.size(), 100U);
  size_t num_true = 0;
  for (const PairPoint& point : points) {
    EXPECT_GE(point.keypoint, 50);
    EXPECT_GE(point.other_keypoint, 50);
    num_true += all_.points[Index(point.keypoint)].id == all_other_.points[Index(point.other_keypoint)].id ? 1U : 0U;
  }
  EXPECT_GT(num_true, points.size() * 9 / 10);
}

TEST_F(PairPoints, TheirDepthIsKnownToHalfAtBest) {
  for (const PairPoint& point : FindPairPoints(KnowsFirst(all_, 0), KnowsFirst(all_other_, 0))) {
    EXPECT_GE(point.in_camera.depth_sigma, 0.5 * point.in_camera.position_in_world.norm());
  }
}

TEST_F(PairPoints, NeedAStep) {
  const TrackedFrame frame = KnowsFirst(all_, 0);
  EXPECT_TRUE(FindPairPoints(frame, frame).empty());
}

}  // namespace
}  // namespace tessera
