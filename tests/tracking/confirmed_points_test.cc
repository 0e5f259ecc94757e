// The pose of a frame in which something moves, on a map of the synthetic world.
#include "tracking/confirmed_points.h"

#include <gtest/gtest.h>

#include <optional>

#include "matching/frame_pose.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// A map of ten keyframes along the drive, and a frame at the last one's step that sees all of its landmarks.
class OptimizeByConfirmedTest : public testing::Test {
 protected:
  OptimizeByConfirmedTest() {
    for (int64_t k = 0; k < 10; ++k) planted_.Add(3 * k, {k - 1});
    for (const MapDelta& delta : planted_.deltas()) EXPECT_THAT(replica_.Apply(delta), IsSuccess());
    frame_.emplace(planted_.FrameOf({9}));
    truth_ = frame_->world_from_camera;
  }
  bool IsConfirmed(size_t keypoint) const {
    return replica_.map().ObservationsOf(frame_->points[keypoint].id.landmark).size() >= 3;
  }
  // All but the first `num_still` of those that are confirmed are new, and have moved as one since they were seen.
  int MoveAllBut(int num_still) {
    int num_moved = 0;
    for (size_t i = 0; i < frame_->points.size(); ++i) {
      SeenPoint& point = frame_->points[i];
      if (!point.valid() || (IsConfirmed(i) && num_still-- > 0)) continue;
      point.id = {{}, {10}, static_cast<int32_t>(i)};
      point.landmark.position_in_world += way_;
      ++num_moved;
    }
    return num_moved;
  }
  PoseOptimizationResult Optimize() { return OptimizeByConfirmed(replica_, {}, nullptr, *frame_).optimized; }

  const Eigen::Vector3d way_{0.4, 0.0, 0.2};
  SyntheticWorld world_{SensorType::kStereo};
  PlantedMap planted_{world_};
  MapReplica replica_;
  Rigid3 truth_;
  std::optional<TrackedFrame> frame_;
};

TEST_F(OptimizeByConfirmedTest, IsThatByAllPointsWhereNoneMoves) {
  TrackedFrame same = *frame_;
  const int num_by_all = OptimizeFrame({}, same);
  EXPECT_EQ(Optimize().num_inliers, num_by_all);
  EXPECT_THAT(frame_->world_from_camera, IsNear(same.world_from_camera, 0.0));
}

TEST_F(OptimizeByConfirmedTest, MostPointsMoveAndDoNotTakeTheCameraAlong) {
  const int num_still = 40;
  const int num_moved = MoveAllBut(num_still);
  ASSERT_GT(num_moved, 2 * num_still);
  EXPECT_GT(Optimize().num_inliers, 30);
  EXPECT_THAT(frame_->world_from_camera, IsNear(truth_, 0.05));
  int num_moved_left = 0;
  for (const SeenPoint& point : frame_->points) num_moved_left += point.id.keyframe.valid() ? 1 : 0;
  EXPECT_LT(num_moved_left, num_moved / 4) << "far ones hardly show that they moved";
}

TEST_F(OptimizeByConfirmedTest, AFewConfirmedPointsDecideNothing) {
  MoveAllBut(10);
  Optimize();
  EXPECT_THAT(frame_->world_from_camera, IsNear(Rigid3{Eigen::Quaterniond::Identity(), way_} * truth_, 0.05))
      << "taken along";
}

}  // namespace
}  // namespace tessera
