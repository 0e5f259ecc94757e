// The bundle adjustment problem of a window of the map, and how its solution changes the map.
#include "optimization/local_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// A chain of ten keyframes, half a meter apart.
class LocalAdjustment : public testing::Test {
 protected:
  static constexpr int64_t kNum = 10;

  void Plant(SensorType sensor) {
    world_.emplace(sensor);
    planted_.emplace(*world_);
    for (int64_t k = 0; k < kNum; ++k) planted_->Add(k, {k - 1});
  }
  // Keyframes 6 .. 9 move, others hold them.
  static LocalWindowOptions FourInner(bool is_double) {
    return {.max_inner_keyframes = 4, .max_outer_keyframes = 4, .is_double = is_double};
  }
  BundleProblem Build(const LocalWindowOptions& options) const {
    return BuildLocalProblem(map(), SelectLocalWindow(map(), {kNum - 1}, options), options);
  }
  template <class Edit>
  void Change(const Edit& edit) {
    MapEditor editor(planted_->map());
    edit(editor);
    (void)editor.Finish({kNum - 1});
  }
  // This share of what the last keyframe observes is seen at another one's keypoint.
  static void ShiftObservations(double share, MapEditor& editor) {
    std::vector<std::pair<LandmarkId, Observation>> seen;
    const Keyframe& last = *editor.map().FindKeyframe({kNum - 1});
    for (size_t i = 0; i < last.landmarks.size(); ++i) {
      if (last.landmarks[i].valid()) seen.push_back({last.landmarks[i], {{kNum - 1}, static_cast<int32_t>(i)}});
    }
    seen.resize(static_cast<size_t>(share * static_cast<double>(seen.size())));
    for (const auto& [landmark, observation] : seen) editor.RemoveObservation(landmark, observation);
    for (size_t i = 0; i < seen.size(); ++i) {
      editor.AddObservation(seen[i].first, seen[(i + seen.size() / 2) % seen.size()].second);
    }
  }
  const Map& map() const { return planted_->map(); }
  static const BundlePose& PoseOf(const BundleProblem& problem, KeyframeId id) {
    return *std::find_if(problem.poses.begin(), problem.poses.end(), [&](const BundlePose& p) { return p.id == id; });
  }

  std::optional<SyntheticWorld> world_;
  std::optional<PlantedMap> planted_;
};

TEST_F(LocalAdjustment, InnerPosesAreFreeAndOuterOnesFixed) {
  Plant(SensorType::kMono);
  const BundleProblem problem = Build(FourInner(false));
  ASSERT_EQ(problem.poses.size(), 8U);
  for (const BundlePose& pose : problem.poses) EXPECT_EQ(pose.is_fixed, pose.id < KeyframeId{6}) << pose.id.value;
  EXPECT_EQ(problem.scale_pose, -1) << "several fixed poses hold the scale";
  EXPECT_TRUE(problem.constraints.empty());
}

TEST_F(LocalAdjustment, EveryLandmarkHasTwoObservationsAtLeast) {
  Plant(SensorType::kMono);
  const BundleProblem problem = Build(FourInner(false));
  std::vector<int> num_observations(problem.points.size(), 0);
  for (const BundleObservation& o : problem.observations) ++num_observations[static_cast<size_t>(o.point)];
  ASSERT_FALSE(problem.points.empty());
  EXPECT_GE(*std::min_element(num_observations.begin(), num_observations.end()), 2);
}

// A window that is the whole map has no outer poses: the root is the gauge, and mono keeps one distance.
TEST_F(LocalAdjustment, TheRootIsFixedAndMonoKeepsAScale) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    Plant(sensor);
    const BundleProblem problem = Build({.max_inner_keyframes = 20, .min_shared_landmarks = 1});
    ASSERT_EQ(problem.poses.size(), static_cast<size_t>(kNum));
    for (const BundlePose& pose : problem.poses) EXPECT_EQ(pose.is_fixed, pose.id == KeyframeId{0});
    EXPECT_EQ(problem.scale_pose, sensor == SensorType::kMono ? 1 : -1);
  }
}

// A solution that takes half of its observations from a keyframe has lost it, whatever its costs.
TEST_F(LocalAdjustment, IsNotTakenWhereItLosesAKeyframe) {
  for (const double share : {0.3, 0.7}) {
    Plant(SensorType::kMono);
    Change([&](MapEditor& editor) { ShiftObservations(share, editor); });
    const Rigid3 before = map().FindKeyframe({kNum - 2})->world_from_camera;
    Change([](MapEditor& editor) { AdjustLocally({kNum - 1}, FourInner(false), {}, {}, editor); });
    const Rigid3& after = map().FindKeyframe({kNum - 2})->world_from_camera;
    EXPECT_EQ(after.translation == before.translation, share > 0.5) << share;
  }
}

TEST_F(LocalAdjustment, TheDoubleWindowHoldsOuterPosesByTheirRelativePoses) {
  Plant(SensorType::kStereo);
  const BundleProblem problem = Build(FourInner(true));
  for (const BundleObservation& o : problem.observations) {
    EXPECT_GE(problem.poses[static_cast<size_t>(o.pose)].id, KeyframeId{6}) << "outer poses observe nothing";
  }
  int num_fixed = 0;
  for (const BundlePose& pose : problem.poses) num_fixed += pose.is_fixed ? 1 : 0;
  EXPECT_EQ(num_fixed, 1);
  ASSERT_FALSE(problem.constraints.empty());
  EXPECT_LE(problem.constraints.size(), 4U * kMaxConstraints);
  for (const RelativePoseConstraint& c : problem.constraints) {
    const Rigid3& from = problem.poses[static_cast<size_t>(c.from)].camera_from_world;
    const Rigid3& to = problem.poses[static_cast<size_t>(c.to)].camera_from_world;
    EXPECT_THAT(c.to_from_from, IsNear(to * from.Inverse(), 1e-12));
  }
}

TEST_F(LocalAdjustment, BringsADisplacedKeyframeBack) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    Plant(sensor);
    const Rigid3 truth = map().FindKeyframe({9})->world_from_camera;
    Eigen::Matrix<double, 6, 1> error;
    error << 0.05, -0.03, 0.04, 0.005, -0.004, 0.003;
    Change([&](MapEditor& editor) { editor.MoveKeyframe({9}, Retract(truth, error)); });
    Change([&](MapEditor& editor) { AdjustLocally({9}, {}, {}, {}, editor); });
    EXPECT_THAT(map().FindKeyframe({9})->world_from_camera, IsNear(truth, 2e-3)) << ToString(sensor);
  }
}

// Relative to a keyframe of the window, in its units and axes.
TEST_F(LocalAdjustment, AnExpectedMotionHoldsAPoseThatNothingElseHolds) {
  Plant(SensorType::kMono);
  const Rigid3 reference = map().FindKeyframe({8})->world_from_camera;
  const Eigen::Vector3d expected = reference.Inverse() * Eigen::Vector3d(world_->Pose(9.0).translation);
  const KeyframeMotions motions{{{9}, {{8}, {expected, 1e4 * Eigen::Matrix3d::Identity()}}}};
  const LocalWindowOptions options = FourInner(false);
  BundleProblem problem = BuildLocalProblem(map(), SelectLocalWindow(map(), {9}, options), options, motions);
  ASSERT_EQ(problem.constraints.size(), 1U);
  std::erase_if(problem.observations, [&](const BundleObservation& o) {
    return problem.poses[static_cast<size_t>(o.pose)].id == KeyframeId{9};
  });
  auto& displaced = problem.poses[static_cast<size_t>(problem.constraints[0].to)];
  ASSERT_EQ(displaced.id, KeyframeId{9});
  displaced.camera_from_world =
      (world_->Pose(9.0) * Rigid3{Eigen::Quaterniond::Identity(), {0.1, 0.2, -0.3}}).Inverse();
  const std::optional<BundleResult> result = AdjustBundle(problem, {});
  ASSERT_TRUE(result);
  const Rigid3& adjusted = result->camera_from_world[static_cast<size_t>(problem.constraints[0].to)];
  EXPECT_LT((adjusted.Inverse().translation - world_->Pose(9.0).translation).norm(), 1e-3);
}

TEST_F(LocalAdjustment, AnExpectedMotionNeedsBothKeyframesInTheWindow) {
  Plant(SensorType::kMono);
  const MotionPrior expected{{0.0, 0.0, 0.5}, Eigen::Matrix3d::Identity()};
  const LocalWindowOptions options = FourInner(false);
  const LocalWindow window = SelectLocalWindow(map(), {9}, options);
  EXPECT_TRUE(BuildLocalProblem(map(), window, options, {{{9}, {{77}, expected}}}).constraints.empty());
  EXPECT_TRUE(BuildLocalProblem(map(), window, options, {{{5}, {{4}, expected}}}).constraints.empty())
      << "both are fixed";
}

// Pairs that only look alike: their rays meet somewhere, and they may be many.
TEST_F(LocalAdjustment, LandmarksThatFewSeeFollowThePosesAndDontMoveThem) {
  Plant(SensorType::kMono);
  std::vector<LandmarkId> few;
  map().landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    const std::span<const Observation> seen = map().ObservationsOf(id);
    if (seen.size() == 2 && seen.back().keyframe == KeyframeId{9}) few.push_back(id);
  });
  ASSERT_GT(few.size(), 10U);
  const Rigid3 truth = map().FindKeyframe({9})->world_from_camera;
  Change([&](MapEditor& editor) {
    for (const LandmarkId id : few) {
      Landmark landmark = *map().FindLandmark(id);
      landmark.position_in_world += Eigen::Vector3d(0.2, 0.0, 1.0);
      editor.ChangeLandmark(id, landmark);
    }
  });
  Change([&](MapEditor& editor) { AdjustLocally({9}, {}, {}, {}, editor); });
  EXPECT_THAT(map().FindKeyframe({9})->world_from_camera, IsNear(truth, 1e-6));
  for (const LandmarkId id : few) {
    const size_t point = planted_->PointOf(map().ObservationsOf(id).front());
    EXPECT_THAT(map().FindLandmark(id)->position_in_world, IsNear(world_->point(point), 1e-3)) << "they follow";
  }
}

TEST_F(LocalAdjustment, OutliersLoseTheirObservation) {
  Plant(SensorType::kStereo);
  // Two landmarks that many keyframes observe are exchanged in keyframe 9.
  std::vector<Observation> at;
  std::vector<LandmarkId> landmarks;
  for (size_t i = 0; i < map().FindKeyframe({9})->landmarks.size() && at.size() < 2; ++i) {
    const LandmarkId id = map().FindKeyframe({9})->landmarks[i];
    if (map().ObservationsOf(id).size() < 5) continue;
    at.push_back({{9}, static_cast<int32_t>(i)});
    landmarks.push_back(id);
  }
  ASSERT_EQ(at.size(), 2U);
  const size_t num_before = map().ObservationsOf(landmarks[0]).size();
  Change([&](MapEditor& editor) {
    for (size_t i = 0; i < 2; ++i) editor.RemoveObservation(landmarks[i], at[i]);
    for (size_t i = 0; i < 2; ++i) editor.AddObservation(landmarks[i], at[1 - i]);
  });
  Change([&](MapEditor& editor) { AdjustLocally({9}, {}, {}, {}, editor); });
  for (const LandmarkId id : landmarks) EXPECT_FALSE(map().IsSeenBy(id, {9}));
  EXPECT_EQ(map().ObservationsOf(landmarks[0]).size(), num_before - 1);
}

TEST_F(LocalAdjustment, LandmarksLeftWithOneObservationGoAndThoseOfASingleKeyframeMoveAlong) {
  Plant(SensorType::kStereo);
  const BundleProblem problem = Build(FourInner(false));
  BundleResult result;
  for (const BundlePose& pose : problem.poses) result.camera_from_world.push_back(pose.camera_from_world);
  for (const BundlePoint& point : problem.points) result.positions_in_world.push_back(point.position_in_world);
  result.is_inlier.assign(problem.observations.size(), 1);
  // Keyframe 9 rises by a meter; of the first point all observations but one are outliers.
  const auto newest = static_cast<size_t>(&PoseOf(problem, {9}) - problem.poses.data());
  const Rigid3 rise{Eigen::Quaterniond::Identity(), {0.0, 1.0, 0.0}};
  result.camera_from_world[newest] = rise * result.camera_from_world[newest];
  bool keeps_one = false;
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    if (problem.observations[i].point != 0) continue;
    result.is_inlier[i] = keeps_one ? 0 : 1;
    keeps_one = true;
  }
  LandmarkId own;
  for (const LandmarkId id : map().FindKeyframe({9})->landmarks) {
    if (map().ObservationsOf(id).size() == 1) own = id;
  }
  ASSERT_TRUE(own.valid());
  const Rigid3 before = map().FindKeyframe({9})->world_from_camera;
  const Eigen::Vector3d in_camera = before.Inverse() * map().FindLandmark(own)->position_in_world;
  const size_t num_in_map = map().ObservationsOf(problem.points[0].id).size();
  const size_t num_in_problem =
      static_cast<size_t>(std::count_if(problem.observations.begin(), problem.observations.end(),
                                        [](const BundleObservation& o) { return o.point == 0; }));
  Change([&](MapEditor& editor) { WriteBack(problem, result, editor); });
  const Rigid3& after = map().FindKeyframe({9})->world_from_camera;
  EXPECT_THAT(after.Inverse(), IsNear(result.camera_from_world[newest], 1e-12));
  EXPECT_THAT(after.Inverse() * map().FindLandmark(own)->position_in_world, IsNear(in_camera, 1e-9));
  const bool is_left = num_in_map - num_in_problem + 1 >= 2;
  EXPECT_EQ(map().FindLandmark(problem.points[0].id) != nullptr, is_left);
}

}  // namespace
}  // namespace tessera
