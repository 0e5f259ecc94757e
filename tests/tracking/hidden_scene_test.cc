// A body that moves in front of the scene, told by the points that stood still before.
#include "tracking/hidden_scene.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr int64_t kSecond = 1'000'000;

// On which 200 points agree.
StepPose PoseWith(int num_confirmed, int num_confirmed_matches) {
  StepPose pose;
  pose.optimized.num_inliers = 200;
  pose.num_confirmed = num_confirmed;
  pose.num_confirmed_matches = num_confirmed_matches;
  return pose;
}
constexpr MotionAgreement kJumps = MotionAgreement::kJumps, kOpen = MotionAgreement::kOpen,
                          kGoesOn = MotionAgreement::kGoesOn;

class HiddenSceneTest : public testing::Test {
 protected:
  HiddenSceneTest() { scene_.See(PoseWith(100, 110), kSecond); }
  HiddenScene scene_;
};

TEST_F(HiddenSceneTest, ConfirmedPointsThatContradictAPoseHideIt) {
  EXPECT_TRUE(scene_.IsBehind(PoseWith(5, 20), kOpen, kSecond));
  EXPECT_FALSE(scene_.IsBehind(PoseWith(40, 100), kJumps, kSecond)) << "a jerk, on which they agree";
}

// Among vehicles that drive as fast, many confirmed points are theirs.
TEST_F(HiddenSceneTest, ASteadyMotionThatGoesOnCountsMore) {
  EXPECT_FALSE(scene_.IsBehind(PoseWith(5, 20), kGoesOn, kSecond));
  scene_.Hide(2 * kSecond);
  EXPECT_FALSE(scene_.IsBehind(PoseWith(20, 20), kGoesOn, 4 * kSecond));
}

// A drone that is knocked over before it has ever flown: what it sees then is as good as what it saw before.
TEST_F(HiddenSceneTest, IsKnownOnceConfirmedPointsWereSeen) {
  EXPECT_TRUE(scene_.is_known());
  HiddenScene young;
  young.See(PoseWith(0, 0), kSecond);
  EXPECT_FALSE(young.is_known());
}

TEST_F(HiddenSceneTest, WhereTheyAreGoneAJumpHidesIt) {
  EXPECT_TRUE(scene_.IsBehind(PoseWith(2, 2), kJumps, kSecond));
  EXPECT_TRUE(scene_.IsBehind(PoseWith(20, 25), kJumps, kSecond)) << "few of many points, where they were the half";
  EXPECT_FALSE(scene_.IsBehind(PoseWith(2, 2), kOpen, kSecond)) << "a turn into what is new";
}

TEST_F(HiddenSceneTest, WithoutConfirmedPointsAMomentAgoNothingIsSaid) {
  EXPECT_FALSE(HiddenScene().IsBehind(PoseWith(0, 0), kJumps, kSecond)) << "a map that has just begun";
  EXPECT_FALSE(scene_.IsBehind(PoseWith(0, 0), kJumps, 3 * kSecond));
}

TEST_F(HiddenSceneTest, IsBackWhenManyConfirmedPointsAgreeAndTheCameraIsWhereItWas) {
  scene_.Hide(2 * kSecond);
  ASSERT_TRUE(scene_.is_hidden());
  EXPECT_TRUE(scene_.IsBehind(PoseWith(20, 20), kOpen, 4 * kSecond));
  EXPECT_TRUE(scene_.IsBehind(PoseWith(40, 45), kJumps, 4 * kSecond));
  EXPECT_FALSE(scene_.IsBehind(PoseWith(40, 45), kOpen, 4 * kSecond));
}

TEST_F(HiddenSceneTest, MayBeHiddenAgainForASecond) {
  scene_.Hide(2 * kSecond);
  scene_.See(PoseWith(40, 45), 2 * kSecond + kSecond / 2);
  EXPECT_TRUE(scene_.is_hidden());
  scene_.See(PoseWith(40, 45), 2 * kSecond + 2 * kSecond);
  EXPECT_FALSE(scene_.is_hidden());
  scene_.Hide(5 * kSecond);
  scene_.EndHiding();
  EXPECT_FALSE(scene_.is_hidden());
}

TEST_F(HiddenSceneTest, MostOfManyConfirmedPointsLeaveNoDoubt) {
  EXPECT_TRUE(scene_.IsSure(PoseWith(30, 33), kOpen, kSecond));
  EXPECT_FALSE(scene_.IsSure(PoseWith(30, 33), kJumps, kSecond));
  EXPECT_FALSE(scene_.IsSure(PoseWith(30, 60), kOpen, kSecond));
  EXPECT_FALSE(scene_.IsSure(PoseWith(20, 20), kOpen, kSecond));
  EXPECT_FALSE(scene_.IsSure(PoseWith(30, 33), kOpen, 3 * kSecond));
}

}  // namespace
}  // namespace tessera
