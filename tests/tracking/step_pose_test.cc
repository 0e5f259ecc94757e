// The pose between images and motion, on the synthetic world.
#include "tracking/step_pose.h"

#include <gtest/gtest.h>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Half a meter forward from the world's first frame, in meters.
class StepPoseTest : public testing::TestWithParam<SensorType> {
 protected:
  StepPose Optimize(const ExpectedStep* expected, TrackedFrame& frame) const {
    return OptimizeStep(replica_, {}, expected, frame);
  }
  // So far as the camera goes, and by that much less.
  static ExpectedStep Expected(double shortfall_m) {
    ExpectedStep expected;
    expected.motion.last_from_current = SyntheticWorld::Pose(0.0).Inverse() * SyntheticWorld::Pose(1.0);
    expected.motion.last_from_current.translation.z() -= shortfall_m;
    expected.motion.covariance = 0.01 * 0.01 * Eigen::Matrix3d::Identity();
    expected.motion.is_learned = expected.motion.is_steady = true;
    expected.reference_from_last = SyntheticWorld::Pose(0.0);
    return expected;
  }
  // The frame there, with its points known, somewhat off its pose.
  TrackedFrame Frame() {
    TrackedFrame frame = world_.TrackedAt(1);
    frame.world_from_camera = frame.world_from_camera * Rigid3{ExpSO3({0.002, 0.0, 0.0}), {0.02, 0.0, 0.02}};
    return frame;
  }

  SyntheticWorld world_{GetParam(), 0.3};
  const MapReplica replica_;
  const Rigid3 truth_ = SyntheticWorld::Pose(1.0);
};

INSTANTIATE_TEST_SUITE_P(Sensors, StepPoseTest, testing::Values(SensorType::kMono, SensorType::kStereo));

TEST_P(StepPoseTest, WithoutAMotionTheImagesCount) {
  TrackedFrame frame = Frame();
  const StepPose pose = Optimize(nullptr, frame);
  EXPECT_EQ(pose.evidence, StepEvidence::kStrong);
  EXPECT_FALSE(pose.is_doubtful);
  EXPECT_THAT(frame.world_from_camera, IsNear(truth_, 0.01));
}

TEST_P(StepPoseTest, ImagesThatFixTheStepCountAlone) {
  const ExpectedStep expected = Expected(0.03);
  TrackedFrame frame = Frame(), alone = frame;
  Optimize(nullptr, alone);
  const StepPose pose = Optimize(&expected, frame);
  EXPECT_EQ(pose.evidence, StepEvidence::kStrong);
  EXPECT_THAT(frame.world_from_camera, IsNear(alone.world_from_camera, 0.002));
}

// Ten points whose depths are known only to a camera that measures them.
TEST_P(StepPoseTest, WhereImagesLeaveTheStepOpenTheMotionCarriesIt) {
  const ExpectedStep expected = Expected(0.0);
  TrackedFrame frame = Frame();
  size_t num_left = 0;
  for (SeenPoint& point : frame.points) {
    if (point.valid() && ++num_left > 10) point = {};
    point.landmark.depth_sigma = 100.0;
  }
  const StepPose pose = Optimize(&expected, frame);
  EXPECT_EQ(pose.evidence, GetParam() == SensorType::kMono ? StepEvidence::kWeak : StepEvidence::kStrong);
  EXPECT_FALSE(pose.is_doubtful);
  EXPECT_LT((frame.world_from_camera.translation - expected.WorldFromCamera().translation).norm(), 0.03);
}

TEST_P(StepPoseTest, AnotherStepThanExpectedIsTakenAndTold) {
  const ExpectedStep expected = Expected(-1.0);
  TrackedFrame frame = Frame();
  const StepPose pose = Optimize(&expected, frame);
  EXPECT_EQ(pose.evidence, StepEvidence::kContradictory);
  EXPECT_TRUE(pose.is_doubtful);
  EXPECT_THAT(frame.world_from_camera, IsNear(truth_, 0.01));
}

}  // namespace
}  // namespace tessera
