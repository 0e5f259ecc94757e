#include "optimization/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "support/synthetic_problems.h"

namespace tessera {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

BundleOptions Exhaustive() {
  BundleOptions options;
  options.max_num_iterations = 50;
  options.function_tolerance = 0.0;
  return options;
}

double Distance(const Rigid3& a, const Rigid3& b) { return (a.Matrix() - b.Matrix()).norm(); }

bool SameBits(const Rigid3& a, const Rigid3& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

double MaxPoseError(const BundleResult& result, const std::vector<Rigid3>& truth) {
  double error = 0.0;
  for (size_t i = 0; i < truth.size(); ++i) {
    error = std::max(error, Distance(result.camera_from_world[i], truth[i]));
  }
  return error;
}

double MaxPointError(const BundleResult& result, const std::vector<Eigen::Vector3d>& truth) {
  double error = 0.0;
  for (size_t i = 0; i < truth.size(); ++i) {
    error = std::max(error, (result.positions_in_world[i] - truth[i]).norm());
  }
  return error;
}

void ExpectRecovered(const SyntheticBundle& bundle) {
  const auto result = AdjustBundle(bundle.problem, Exhaustive());
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(MaxPoseError(*result, bundle.camera_from_world), 1e-6);
  EXPECT_LT(MaxPointError(*result, bundle.positions_in_world), 1e-6);
  EXPECT_EQ(result->num_inliers, static_cast<int>(bundle.problem.observations.size()));
  EXPECT_GT(result->initial_cost, 1.0);
  EXPECT_LT(result->final_cost, 1e-9);
}

TEST(AdjustBundle, RecoversAMonoWorldBetweenTwoFixedPoses) { ExpectRecovered(MakeSyntheticBundle({})); }

TEST(AdjustBundle, RecoversAStereoWorldFromOneFixedPose) {
  ExpectRecovered(MakeSyntheticBundle({.num_fixed = 1, .share_with_right = 1.0}));
}

TEST(AdjustBundle, RecoversAMixedWorldFromOneFixedPose) {
  ExpectRecovered(MakeSyntheticBundle({.num_fixed = 1, .share_with_right = 0.4}));
}

TEST(AdjustBundle, RecoversStructureAloneWhenAllPosesAreFixed) {
  ExpectRecovered(MakeSyntheticBundle({.num_fixed = 8}));
}

TEST(AdjustBundle, AllSolversGiveTheSame) {
  for (const double share : {0.0, 0.5}) {
    const SyntheticBundle bundle = MakeSyntheticBundle({.share_with_right = share, .pixel_noise_px = 0.5});
    BundleOptions sparse = Exhaustive(), ceres = Exhaustive(), slow = Exhaustive();
    sparse.max_num_dense_poses = 0;
    ceres.is_always_ceres = true;
    slow.has_slow_modes = true;
    const auto a = AdjustBundle(bundle.problem, Exhaustive()), b = AdjustBundle(bundle.problem, sparse);
    const auto c = AdjustBundle(bundle.problem, ceres), d = AdjustBundle(bundle.problem, slow);
    ASSERT_TRUE(a && b && c && d);
    EXPECT_LT(MaxPoseError(*a, b->camera_from_world), 1e-7);
    EXPECT_LT(MaxPoseError(*a, c->camera_from_world), 1e-7);
    EXPECT_LT(MaxPoseError(*a, d->camera_from_world), 1e-7);
    EXPECT_EQ(a->is_inlier, b->is_inlier);
  }
}

// One round of SchurSolver or of Ceres, as far as `max_num_iterations` go.
BundleResult AfterIterations(const BundleProblem& problem, int max_num_iterations, bool is_ceres) {
  BundleOptions options;
  options.function_tolerance = 0.0;
  options.max_num_iterations = max_num_iterations;
  options.num_rounds = 1;
  options.is_always_ceres = is_ceres;
  return AdjustBundle(problem, options).value();
}

// Points of which the start knows the direction well and the distance hardly: at up to 170 baselines of two poses.
SyntheticBundle MakeFarBundle(double share_with_right) {
  return MakeSyntheticBundle({.track_length = 8,
                              .share_with_right = share_with_right,
                              .pixel_noise_px = 0.5,
                              .point_error_m = 0.0,
                              .inverse_depth_error = 0.5,
                              .min_depth_m = 30.0,
                              .depth_range_m = 106.0});
}

// SchurSolver damps points otherwise than Ceres and moves them by inverse depth, so it takes other steps; outliers and
// constraints included, these lead to the same minimum. (From farther away they need not: then Ceres sometimes leaves a
// point behind a camera.)
TEST(AdjustBundle, SchurSolverEndsAtTheMinimumOfCeres) {
  const SyntheticBundleOptions near{.pixel_noise_px = 1.0};
  SyntheticBundleOptions mixed = near, stereo = near;
  mixed.share_with_right = 0.5;
  stereo.share_with_right = 1.0;
  std::vector<SyntheticBundle> bundles{MakeSyntheticBundle(near), MakeSyntheticBundle(mixed),
                                       MakeSyntheticBundle(stereo), MakeFarBundle(0.0), MakeFarBundle(1.0)};
  // A depth sensor's, with a sigma of its own.
  bundles.push_back(MakeSyntheticBundle(stereo));
  for (BundleObservation& o : bundles.back().problem.observations) o.seen.disparity_sigma_px = 2.0;
  for (size_t k = 0; k < bundles.size(); ++k) {
    BundleProblem& problem = bundles[k].problem;
    for (size_t i = 0; i < problem.observations.size(); i += 13) {
      problem.observations[i].seen.pixel_px += Eigen::Vector2d(30.0, -20.0);
    }
    for (int i = 2; i < 7; ++i) {
      const auto from = static_cast<size_t>(i);
      const Rigid3 motion = bundles[k].camera_from_world[from + 1] * bundles[k].camera_from_world[from].Inverse();
      problem.constraints.push_back({i, i + 1, motion, 1e3 * Eigen::Matrix<double, 6, 6>::Identity()});
    }
    const BundleResult own = AfterIterations(problem, 200, false), ceres = AfterIterations(problem, 200, true);
    EXPECT_NEAR(own.initial_cost / ceres.initial_cost, 1.0, 1e-12) << k;
    EXPECT_NEAR(own.final_cost / ceres.final_cost, 1.0, 1e-6) << k;
    EXPECT_LT(MaxPoseError(own, ceres.camera_from_world), 1e-4) << k;
  }
}

// Damping by the world's axes holds a far point's depth as firmly as its direction, which is known a thousand times
// better; and distances, unlike inverse ones, are not linear in what is seen.
TEST(AdjustBundle, SchurSolverPlacesFarPointsInFewIterations) {
  for (const double share_with_right : {0.0, 1.0}) {
    const BundleProblem problem = MakeFarBundle(share_with_right).problem;
    const double minimum = AfterIterations(problem, 200, true).final_cost;
    const auto excess = [&](int iterations, bool is_ceres) {
      return AfterIterations(problem, iterations, is_ceres).final_cost / minimum - 1.0;
    };
    EXPECT_LT(excess(2, false), 1e-3);
    EXPECT_GT(excess(2, true), 0.1);
    EXPECT_LT(excess(5, false), 0.1 * excess(5, true));
  }
}

// After a loop the error that is left deforms the whole street: meters, for a millionth of the cost.
TEST(AdjustBundle, StraightensAStreetAfterItsLoop) {
  const SyntheticBundle bundle = MakeSyntheticStreet({.num_keyframes = 150, .num_new_landmarks = 30});
  const auto rms = [&](const std::vector<Rigid3>& camera_from_world) {
    std::vector<Eigen::Vector3d> centers, truth;
    for (size_t i = 0; i < camera_from_world.size(); ++i) {
      centers.push_back(camera_from_world[i].Inverse().translation);
      truth.push_back(bundle.camera_from_world[i].Inverse().translation);
    }
    return AlignPoints(centers, truth, true)->rms;
  };
  std::vector<Rigid3> start;
  for (const BundlePose& pose : bundle.problem.poses) start.push_back(pose.camera_from_world);
  const auto result = AdjustBundle(bundle.problem, GlobalBundleOptions());
  BundleOptions exhaustive = GlobalBundleOptions();
  exhaustive.max_num_iterations = 100;
  exhaustive.function_tolerance = 1e-10;
  const auto limit = AdjustBundle(bundle.problem, exhaustive);
  ASSERT_TRUE(result && limit);
  EXPECT_LT(rms(result->camera_from_world), 0.3 * rms(start));
  EXPECT_LT(rms(result->camera_from_world), 1.3 * rms(limit->camera_from_world));
}

// To half a unit of chi-square, which says nothing any more, where thousands of observations hold few modes.
TEST(AdjustBundle, AWholeStreetEndsAtItsMinimum) {
  for (const double share : {0.0, 0.7}) {
    const SyntheticBundle bundle =
        MakeSyntheticStreet({.num_keyframes = 300, .num_new_landmarks = 20, .share_with_right = share});
    BundleOptions exhaustive = GlobalBundleOptions();
    exhaustive.max_num_iterations = 100;
    exhaustive.function_tolerance = 0.0;
    const auto result = AdjustBundle(bundle.problem, GlobalBundleOptions());
    const auto limit = AdjustBundle(bundle.problem, exhaustive);
    ASSERT_TRUE(result && limit);
    EXPECT_LT(result->final_cost, limit->final_cost + 0.5);
    EXPECT_LT(result->num_iterations, 25);
  }
}

TEST(AdjustBundle, TwoViewsKeepTheFirstPoseAndTheDistanceToTheSecond) {
  SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 2, .track_length = 2, .num_fixed = 1});
  bundle.problem.scale_pose = 1;
  const auto result = AdjustBundle(bundle.problem, Exhaustive());
  ASSERT_TRUE(result.has_value());
  EXPECT_TRUE(SameBits(result->camera_from_world[0], bundle.problem.poses[0].camera_from_world));
  const auto distance = [](const Rigid3& camera_from_world) { return camera_from_world.Inverse().translation.norm(); };
  const double start = distance(bundle.problem.poses[1].camera_from_world);
  EXPECT_NEAR(distance(result->camera_from_world[1]), start, 1e-12);
  // All else is the true world in that scale (the first camera stands at the origin).
  const double scale = start / distance(bundle.camera_from_world[1]);
  for (size_t i = 0; i < bundle.positions_in_world.size(); ++i) {
    EXPECT_LT((result->positions_in_world[i] - scale * bundle.positions_in_world[i]).norm(), 1e-6);
  }
}

TEST(AdjustBundle, FixedPosesKeepTheirBits) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.num_fixed = 3, .pixel_noise_px = 1.0});
  const auto result = AdjustBundle(bundle.problem, {});
  ASSERT_TRUE(result.has_value());
  for (size_t i = 0; i < bundle.problem.poses.size(); ++i) {
    EXPECT_EQ(SameBits(result->camera_from_world[i], bundle.problem.poses[i].camera_from_world), i < 3) << i;
  }
}

TEST(AdjustBundle, LowersTheCostOfANoisyWorldAndStaysNearTheTruth) {
  for (const double share : {0.0, 0.5}) {
    const SyntheticBundle bundle = MakeSyntheticBundle({.share_with_right = share, .pixel_noise_px = 0.7});
    const auto result = AdjustBundle(bundle.problem, {});
    ASSERT_TRUE(result.has_value());
    EXPECT_LT(result->final_cost, 0.2 * result->initial_cost);
    EXPECT_LT(MaxPoseError(*result, bundle.camera_from_world), 0.05);
  }
}

TEST(AdjustBundle, RejectsOutliersAndRecoversTheRest) {
  // Long tracks: of three views in a row, one may lie and still agree with another depth.
  SyntheticBundle bundle = MakeSyntheticBundle({.track_length = 7, .share_with_right = 0.5});
  std::vector<char> is_good(bundle.problem.observations.size(), 1);
  for (size_t i = 0; i < is_good.size(); i += 13) {
    is_good[i] = 0;
    bundle.problem.observations[i].seen.pixel_px += Eigen::Vector2d(30.0, -20.0);
  }
  BundleOptions options = Exhaustive();
  options.num_rounds = 4;
  const auto result = AdjustBundle(bundle.problem, options);
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->is_inlier, is_good);
  EXPECT_LT(MaxPoseError(*result, bundle.camera_from_world), 1e-6);
  EXPECT_LT(MaxPointError(*result, bundle.positions_in_world), 1e-6);
}

TEST(AdjustBundle, SameProblemGivesTheSameBits) {
  for (const int max_num_dense_poses : {0, 60}) {
    const SyntheticBundle bundle = MakeSyntheticBundle({.share_with_right = 0.5, .pixel_noise_px = 1.0});
    BundleOptions options;
    options.max_num_dense_poses = max_num_dense_poses;
    const auto first = AdjustBundle(bundle.problem, options);
    const std::vector<double> moves_the_heap(12345, 1.0);
    const BundleProblem copy = bundle.problem;
    const auto second = AdjustBundle(copy, options);
    ASSERT_TRUE(first && second);
    for (size_t i = 0; i < first->camera_from_world.size(); ++i) {
      EXPECT_TRUE(SameBits(first->camera_from_world[i], second->camera_from_world[i]));
    }
    EXPECT_EQ(first->positions_in_world, second->positions_in_world);
    EXPECT_EQ(first->is_inlier, second->is_inlier);
    EXPECT_EQ(first->final_cost, second->final_cost);
    EXPECT_EQ(first->num_iterations, second->num_iterations);
  }
}

TEST(AdjustBundle, OrderOfObservationsDoesNotMatter) {
  const SyntheticBundle bundle = MakeSyntheticBundle({.pixel_noise_px = 0.5});
  BundleProblem shuffled = bundle.problem;
  std::mt19937_64 generator(11);
  std::shuffle(shuffled.observations.begin(), shuffled.observations.end(), generator);
  const auto a = AdjustBundle(bundle.problem, Exhaustive()), b = AdjustBundle(shuffled, Exhaustive());
  ASSERT_TRUE(a && b);
  EXPECT_LT(MaxPoseError(*a, b->camera_from_world), 1e-9);
  EXPECT_LT(MaxPointError(*a, b->positions_in_world), 1e-7);  // depth of distant points is soft
  EXPECT_EQ(a->num_inliers, b->num_inliers);
}

// The double window: landmarks of the last poses only; the others hang on relative poses.
SyntheticBundle MakeDoubleWindow() {
  SyntheticBundle bundle = MakeSyntheticBundle({.num_poses = 10, .num_fixed = 1, .share_with_right = 1.0});
  BundleProblem& problem = bundle.problem;
  std::erase_if(problem.observations, [](const BundleObservation& o) { return o.pose < 5; });
  for (int i = 0; i + 1 < 8; ++i) {
    const auto from = static_cast<size_t>(i);
    RelativePoseConstraint constraint{i, i + 1, {}, {}};
    constraint.to_from_from = bundle.camera_from_world[from + 1] * bundle.camera_from_world[from].Inverse();
    constraint.information = 1e4 * Eigen::Matrix<double, 6, 6>::Identity();
    problem.constraints.push_back(constraint);
  }
  return bundle;
}

TEST(AdjustBundle, DoubleWindowRecoversInnerAndOuterPoses) {
  const SyntheticBundle bundle = MakeDoubleWindow();
  const auto result = AdjustBundle(bundle.problem, Exhaustive());
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(MaxPoseError(*result, bundle.camera_from_world), 1e-6);
}

TEST(AdjustBundle, WithoutConstraintsTheOuterPosesStay) {
  SyntheticBundle bundle = MakeDoubleWindow();
  bundle.problem.constraints.clear();
  const auto result = AdjustBundle(bundle.problem, {});
  ASSERT_TRUE(result.has_value());
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_LT(Distance(result->camera_from_world[i], bundle.problem.poses[i].camera_from_world), 1e-12);
  }
}

TEST(AdjustBundle, ConstraintsAloneAreAPoseGraph) {
  SyntheticBundle bundle = MakeDoubleWindow();
  bundle.problem.observations.clear();
  const auto result = AdjustBundle(bundle.problem, Exhaustive());
  ASSERT_TRUE(result.has_value());
  for (size_t i = 0; i < 8; ++i) {
    EXPECT_LT(Distance(result->camera_from_world[i], bundle.camera_from_world[i]), 1e-6);
  }
}

TEST(AdjustBundle, NothingToOptimizeGivesNothing) {
  EXPECT_FALSE(AdjustBundle({.calibration = SyntheticCamera(), .poses = {{KeyframeId{0}, {}, true}}}, {}));
  SyntheticBundle bundle = MakeSyntheticBundle({});
  bundle.problem.observations.clear();
  EXPECT_FALSE(AdjustBundle(bundle.problem, {}));
}

TEST(AdjustBundle, OneKeyframeWithDepthPlacesItsPoints) {
  const SyntheticBundle bundle =
      MakeSyntheticBundle({.num_poses = 1, .track_length = 1, .num_fixed = 1, .share_with_right = 1.0});
  ExpectRecovered(bundle);
}

TEST(AdjustBundle, PointBehindTheCameraIsAnOutlierAndDoesNoHarm) {
  SyntheticBundle bundle = MakeSyntheticBundle({});
  const Eigen::Vector3d behind(0.0, 0.0, -20.0);
  bundle.problem.points[3].position_in_world = behind;
  const auto result = AdjustBundle(bundle.problem, Exhaustive());
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(MaxPoseError(*result, bundle.camera_from_world), 1e-6);
  EXPECT_EQ(result->positions_in_world[3], behind);
  for (size_t i = 0; i < result->is_inlier.size(); ++i) {
    EXPECT_EQ(result->is_inlier[i], bundle.problem.observations[i].point != 3) << i;
  }
}

TEST(AdjustBundle, EverythingBehindTheCameraGivesNothing) {
  SyntheticBundle bundle = MakeSyntheticBundle({});
  for (BundlePoint& point : bundle.problem.points) {
    point.position_in_world.z() = -50.0;
  }
  EXPECT_FALSE(AdjustBundle(bundle.problem, {}));
}

TEST(AdjustBundle, PointsThatStartNearTheCameraPlaneStayFinite) {
  SyntheticBundle bundle = MakeSyntheticBundle({.num_fixed = 1});
  for (size_t i = 0; i < bundle.problem.points.size(); i += 3) {
    bundle.problem.points[i].position_in_world.z() = 0.81 + 1e-5 * static_cast<double>(i);
  }
  const auto result = AdjustBundle(bundle.problem, {});
  ASSERT_TRUE(result.has_value());
  for (const Eigen::Vector3d& position : result->positions_in_world) {
    EXPECT_TRUE(position.allFinite());
  }
}

TEST(AdjustBundle, ValuesThatAreNotFiniteGiveNothing) {
  const SyntheticBundle bundle = MakeSyntheticBundle({});
  const std::vector<std::function<void(BundleProblem&)>> spoilers = {
      [](BundleProblem& p) { p.poses[4].camera_from_world.translation.x() = kNaN; },
      [](BundleProblem& p) { p.poses[0].camera_from_world.rotation.w() = kNaN; },
      [](BundleProblem& p) { p.points[7].position_in_world.y() = std::numeric_limits<double>::infinity(); },
      [](BundleProblem& p) { p.observations[9].seen.pixel_px.y() = kNaN; },
      // Not a number there means that no column is known (kNoColumn), which is fine.
      [](BundleProblem& p) { p.observations[9].seen.right_x_px = std::numeric_limits<double>::infinity(); },
  };
  for (size_t i = 0; i < spoilers.size(); ++i) {
    BundleProblem problem = bundle.problem;
    spoilers[i](problem);
    EXPECT_FALSE(AdjustBundle(problem, {})) << i;
  }
}

TEST(AdjustBundle, MalformedProblemsThrowWithASentence) {
  const SyntheticBundle bundle = MakeSyntheticBundle({});
  const std::vector<std::function<void(BundleProblem&)>> spoilers = {
      [](BundleProblem& p) { p.observations[5].pose = 99; },
      [](BundleProblem& p) { p.observations[5].point = -1; },
      [](BundleProblem& p) { p.observations[5].seen.sigma_px = 0.0; },
      [](BundleProblem& p) { p.observations[5].seen.sigma_px = kNaN; },
      [](BundleProblem& p) { p.observations[5].seen.right_x_px = 10.0, p.baseline_m = 0.0; },
      [](BundleProblem& p) { p.poses[0].is_fixed = p.poses[1].is_fixed = false; },
      [](BundleProblem& p) { p.scale_pose = 4; },  // two fixed poses fix the scale already
      [](BundleProblem& p) { p.poses[1].is_fixed = false, p.scale_pose = 0; },
      [](BundleProblem& p) { p.constraints.push_back({2, 2, {}, Eigen::Matrix<double, 6, 6>::Identity()}); },
      [](BundleProblem& p) { p.constraints.push_back({2, 3, {}, -Eigen::Matrix<double, 6, 6>::Identity()}); },
      [](BundleProblem& p) { p.calibration.fx_px = 0.0; },
  };
  for (size_t i = 0; i < spoilers.size(); ++i) {
    BundleProblem problem = bundle.problem;
    spoilers[i](problem);
    EXPECT_FALSE(problem.Check()) << i;
    EXPECT_THROW(AdjustBundle(problem, {}), std::invalid_argument) << i;
  }
  EXPECT_THROW(AdjustBundle(bundle.problem, {.max_num_iterations = 0}), std::invalid_argument);
  EXPECT_THROW(AdjustBundle(bundle.problem, {.initial_radius = 0.0}), std::invalid_argument);
  EXPECT_TRUE(GlobalBundleOptions().Check());
}

}  // namespace
}  // namespace tessera
