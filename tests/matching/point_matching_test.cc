// Guided matching on the synthetic world: which keypoint sees which known point, around a predicted pose.
#include "matching/point_matching.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "matching/frame_pose.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// A frame of the world at its true pose that sees nothing yet, and what it should see.
struct NewFrame {
  explicit NewFrame(SyntheticWorld& world, int64_t step)
      : truth(world.TrackedAt(step)), frame(truth.view), pose(truth.world_from_camera) {
    frame.world_from_camera = pose;
  }
  // Keypoints that see another point than they should.
  int NumWrong() const {
    int num_wrong = 0;
    for (size_t i = 0; i < frame.points.size(); ++i) {
      num_wrong += frame.points[i].valid() && frame.points[i].id != truth.points[i].id ? 1 : 0;
    }
    return num_wrong;
  }

  TrackedFrame truth;
  TrackedFrame frame;
  Rigid3 pose;
};

// All points of the world, as a map knows them that saw them at `step`.
KnownPoints AllPoints(const SyntheticWorld& world, double step) {
  KnownPoints points;
  for (size_t i = 0; i < world.num_points(); ++i) {
    const SeenPoint known = world.Known(i, SyntheticWorld::Pose(step));
    points.emplace_back(known.id, known.landmark);
  }
  return points;
}

TEST(MatchLast, FollowsThePointsOfTheLastFrame) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const TrackedFrame last = world.TrackedAt(0);
  NewFrame next(world, 1);
  const int num = MatchLast(last, 15.0, {}, next.frame);
  EXPECT_GT(num, 300);
  EXPECT_EQ(num, next.frame.NumPoints());
  EXPECT_LT(next.NumWrong(), num / 50);
}

TEST(MatchLast, AWrongPredictionNeedsAWiderWindow) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const TrackedFrame last = world.TrackedAt(0);
  NewFrame next(world, 1);
  next.frame.world_from_camera = next.pose * Rigid3{ExpSO3({0.0, 0.06, 0.0}), Eigen::Vector3d::Zero()};  // 30 px
  const int num_narrow = MatchLast(last, 5.0, {}, next.frame);
  const int num_wide = MatchLast(last, 30.0, {}, next.frame);
  EXPECT_GT(num_wide, 10 * std::max(1, num_narrow));
}

TEST(MatchLast, DescriptorsTooFarApartDoNotMatch) {
  SyntheticWorld world(SensorType::kStereo);
  const TrackedFrame last = world.TrackedAt(0);
  NewFrame next(world, 1);
  EXPECT_EQ(MatchLast(last, 15.0, {.max_hamming = 1}, next.frame), 0) << "about 20 bits differ";
}

TEST(MatchLocal, FindsThePointsOfTheMapAroundTheirProjection) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const KnownPoints points = AllPoints(world, 0.0);
  NewFrame next(world, 1);
  const int num = MatchLocal(points, 3.0, {}, next.frame);
  EXPECT_GT(num, next.truth.NumPoints() * 8 / 10);
  EXPECT_LT(next.NumWrong(), num / 50);
}

TEST(MatchLocal, KeepsWhatTheFrameSeesAlready) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const KnownPoints points = AllPoints(world, 0.0);
  NewFrame next(world, 1);
  const SeenPoint other = world.Known(0, next.pose);
  next.frame.points[5] = other;
  MatchLocal(points, 3.0, {}, next.frame);
  EXPECT_EQ(next.frame.points[5].id, other.id);
}

TEST(MatchLocal, TheRightColumnMustFitToo) {
  SyntheticWorld world(SensorType::kStereo);
  const KnownPoints points = AllPoints(world, 1.0);
  FeatureFrame features = world.Take(1).features;
  for (Keypoint& keypoint : features.keypoints) keypoint.right_x_px = std::max(0.0F, keypoint.right_x_px - 40.0F);
  TrackedFrame frame(ViewOf(features));
  frame.world_from_camera = SyntheticWorld::Pose(1.0);
  EXPECT_LT(MatchLocal(points, 3.0, {}, frame), frame.view->size() / 50);
}

TEST(MatchAnywhere, FindsPointsWithoutAPose) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const KnownPoints points = AllPoints(world, 0.0);
  NewFrame next(world, 1);
  next.frame.world_from_camera = {ExpSO3({1.0, 2.0, 0.5}), {100.0, 0.0, 0.0}};
  const int num = MatchAnywhere(points, {}, next.frame);
  EXPECT_GT(num, next.truth.NumPoints() * 9 / 10);
  EXPECT_EQ(next.NumWrong(), 0);
}

TEST(Matching, IsTheSameFromRunToRun) {
  const auto match = [] {
    SyntheticWorld world(SensorType::kStereo, 0.3);
    const TrackedFrame last = world.TrackedAt(0);
    NewFrame next(world, 1);
    MatchLast(last, 15.0, {}, next.frame);
    MatchLocal(AllPoints(world, 0.0), 3.0, {}, next.frame);
    std::vector<PointId> ids;
    for (const SeenPoint& point : next.frame.points) ids.push_back(point.id);
    return ids;
  };
  EXPECT_EQ(match(), match());
}

TEST(MatchOptions, AreChecked) {
  EXPECT_THAT(MatchOptions().Check(), IsSuccess());
  EXPECT_THAT((MatchOptions{.last_radius_px = 0.0}).Check(), IsFailure(HasSubstr("radii")));
  EXPECT_THAT((MatchOptions{.max_hamming = 300}).Check(), IsFailure(HasSubstr("max_hamming")));
}

TEST(OptimizeFrame, MovesTheFrameToItsPointsAndDropsTheWrongOnes) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  NewFrame next(world, 2);
  next.frame = next.truth;
  const int num_points = next.frame.NumPoints();
  for (size_t i = 0; i < next.frame.points.size(); i += 4) next.frame.points[i] = next.truth.points[(i + 7) % 100];
  next.frame.world_from_camera = next.pose * Rigid3{ExpSO3({0.01, -0.02, 0.01}), {0.1, 0.05, -0.1}};
  const int num_inliers = OptimizeFrame({}, next.frame);
  EXPECT_THAT(next.frame.world_from_camera, IsNear(next.pose, 0.02));
  EXPECT_EQ(num_inliers, next.frame.NumPoints());
  EXPECT_GT(num_inliers, num_points * 7 / 10);
  EXPECT_LT(next.NumWrong(), 3);
}

TEST(OptimizeFrame, WithoutPointsTheFrameStays) {
  SyntheticWorld world(SensorType::kStereo);
  NewFrame next(world, 0);
  EXPECT_EQ(OptimizeFrame({}, next.frame), 0);
  EXPECT_THAT(next.frame.world_from_camera, IsNear(next.pose, 1e-12));
}

}  // namespace
}  // namespace tessera
