#include "geometry/pose_optimization.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

#include "support/matchers.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

class OptimizePoseTest : public testing::TestWithParam<bool> {};

// A synthetic world without noise is met to 1e-6, whatever share of wrong matches stands in it.
TEST_P(OptimizePoseTest, RecoversThePoseAndNamesTheOutliers) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const auto points = MakePoints(Scene::kGeneral, truth, 200);
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    observations.push_back({.point_in_world = points[i], .seen = SeePoint(truth * points[i], GetParam() && i % 3 > 0)});
    if (i % 5 == 0) observations.back().seen.pixel_px += Eigen::Vector2d(25.0, -40.0);
  }
  Eigen::Matrix<double, 6, 1> error;
  error << 0.1, -0.05, 0.1, 0.01, -0.02, 0.01;
  const PoseOptimizationResult result =
      OptimizePose(MakeCamera(), kViewBaseline, observations, Retract(truth, error), {});
  EXPECT_THAT(result.camera_from_world, IsNear(truth, 1e-6));
  EXPECT_EQ(result.num_inliers, 160);
  for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(result.is_inlier[i] != 0, i % 5 != 0) << i;
}

INSTANTIATE_TEST_SUITE_P(MonoAndStereo, OptimizePoseTest, testing::Bool());

// Nine in ten points agree on another pose, but those that vote don't.
TEST(OptimizePose, OnlyThoseThatVoteMoveThePose) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const Rigid3 other{truth.rotation, truth.translation + Eigen::Vector3d(0.3, 0.0, 0.0)};
  const auto points = MakePoints(Scene::kGeneral, truth, 200);
  std::vector<PoseObservation> observations;
  for (size_t i = 0; i < points.size(); ++i) {
    const bool votes = i % 10 == 0;
    observations.push_back({.point_in_world = points[i],
                            .seen = SeePoint((votes || i % 10 == 1 ? truth : other) * points[i], true),
                            .votes = votes});
  }
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kViewBaseline, observations, other, {});
  EXPECT_THAT(result.camera_from_world, IsNear(truth, 1e-6));
  EXPECT_EQ(result.num_inliers, 40) << "those that don't vote are told apart, too";
}

TEST(OptimizePose, InformationIsTheCurvatureOfTheCost) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  std::vector<PoseObservation> observations;
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, truth, 1000)) {
    observations.push_back({.point_in_world = point, .seen = SeePoint(truth * point, true)});
  }
  const auto cost = [&](const Eigen::Matrix<double, 6, 1>& delta) {
    double sum = 0.0;
    for (const PoseObservation& o : observations) {
      sum += ReprojectionResidual(MakeCamera(), kViewBaseline, Retract(truth, delta) * o.point_in_world, o.seen)
                 .squaredNorm();
    }
    return 0.5 * sum;
  };
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kViewBaseline, observations, truth, {});
  for (int axis = 0; axis < 6; ++axis) {
    const Eigen::Matrix<double, 6, 1> step = 1e-4 * Eigen::Matrix<double, 6, 1>::Unit(axis);
    const double curvature = (cost(step) + cost(-step) - 2.0 * cost(step - step)) / 1e-8;
    EXPECT_NEAR(curvature / result.information(axis, axis), 1.0, 1e-3) << axis;
  }
}

// What leverage does: the true points are far, and a few false matches claim to be near. All of them agree exactly with
// a camera that moved half as far as it did.
TEST(OptimizePose, AFewNearPointsDontOverruleTheOthers) {
  const Rigid3 truth{Eigen::Quaterniond::Identity(), {0.0, 0.0, -2.0}};
  const Rigid3 false_pose{Eigen::Quaterniond::Identity(), {0.0, 0.0, -1.0}};
  std::vector<PoseObservation> observations;
  const auto add = [&](const Eigen::Vector3d& point, const Rigid3& pose) {
    observations.push_back({.point_in_world = point, .seen = SeePoint(pose * point, false)});
  };
  for (int i = 0; i < 120; ++i) add({i % 2 == 0 ? 30.0 : -30.0, -10.0 + 0.25 * (i % 60), 80.0 + 0.5 * i}, truth);
  for (int i = 0; i < 4; ++i) add({i % 2 == 0 ? 2.0 : -2.0, 0.5 * i - 1.0, 8.0}, false_pose);
  for (const Rigid3& start : {truth, Rigid3::Identity()}) {
    const PoseOptimizationResult result = OptimizePose(MakeCamera(), 0.0, observations, start, {});
    EXPECT_THAT(result.camera_from_world, IsNear(truth, 0.05));
    EXPECT_EQ(result.num_inliers, 120);
  }
}

// Points that a first camera, at the origin, has placed by a triangulation with parallax noise, and what a second one
// sees of them: some are known well, and of others hardly more than the direction.
struct UncertainScene {
  std::vector<PoseObservation> observations;
  Rigid3 truth;  // camera_from_world of the second

  // Says that the points stand where they don't.
  void MakeExact() {
    for (PoseObservation& o : observations) o.depth_sigma_in_world.setZero();
  }
  PoseOptimizationResult Optimize(const PoseOptimizationOptions& options = {}) const {
    return OptimizePose(MakeCamera(), 0.0, observations, truth, options);
  }
};

constexpr double kInverseDepthSigma = 0.008;  // 1/m: 3 % of the distance at 4 m, 20 % at 25 m

UncertainScene MakeUncertainScene(unsigned seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal;
  UncertainScene scene{.observations = {}, .truth = {ExpSO3({0.01, -0.02, 0.005}), {-0.25, 0.0, -0.1}}};
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, scene.truth, 300)) {
    const double inverse = 1.0 / point.norm(), measured = inverse + kInverseDepthSigma * normal(generator);
    const Eigen::Vector3d estimate = point.normalized() / measured;
    PoseObservation o{estimate, -estimate * (kInverseDepthSigma / measured), SeePoint(scene.truth * point, false)};
    o.seen.sigma_px = 0.7;
    const double dx = normal(generator), dy = normal(generator);
    o.seen.pixel_px += o.seen.sigma_px * Eigen::Vector2d(dx, dy);
    scene.observations.push_back(o);
  }
  return scene;
}

// Center of the camera along the true motion, as a share of it.
double ShareOfMotion(const Rigid3& camera_from_world, const Rigid3& truth) {
  const Eigen::Vector3d moved = truth.Inverse().translation;
  return camera_from_world.Inverse().translation.dot(moved) / moved.squaredNorm();
}

// Regression dilution: taken as exact, points with wrong depths make the motion come out too short.
TEST(OptimizePose, WrongDepthsDontShortenTheMotion) {
  constexpr int kNumDraws = 100;
  double sum = 0.0, sum_of_squares = 0.0, sum_if_exact = 0.0;
  for (unsigned seed = 0; seed < kNumDraws; ++seed) {
    UncertainScene scene = MakeUncertainScene(seed);
    const double share = ShareOfMotion(scene.Optimize().camera_from_world, scene.truth);
    sum += share;
    sum_of_squares += share * share;
    scene.MakeExact();
    sum_if_exact += ShareOfMotion(scene.Optimize().camera_from_world, scene.truth);
  }
  const double mean = sum / kNumDraws;
  const double sigma_of_mean = std::sqrt((sum_of_squares / kNumDraws - mean * mean) / kNumDraws);
  EXPECT_NEAR(mean, 1.0, 3.0 * sigma_of_mean);
  EXPECT_LT(sum_if_exact / kNumDraws, 1.0 - 10.0 * sigma_of_mean);
}

// Mean over draws of the normalized estimation error squared: 6, the degrees of freedom, if the information is true.
double MeanNees(const PoseOptimizationOptions& options, int num_draws, bool is_exact) {
  double sum = 0.0;
  for (int seed = 0; seed < num_draws; ++seed) {
    UncertainScene scene = MakeUncertainScene(static_cast<unsigned>(seed));
    if (is_exact) scene.MakeExact();
    const PoseOptimizationResult result = scene.Optimize(options);
    const Rigid3 error = result.camera_from_world * scene.truth.Inverse();
    Eigen::Matrix<double, 6, 1> tangent;
    tangent << error.translation, LogSO3(error.rotation);
    sum += tangent.dot(result.information * tangent);
  }
  return sum / num_draws;
}

TEST(OptimizePose, TheInformationSaysHowWrongThePoseIs) {
  constexpr int kNumDraws = 200;
  const double band = 1.96 * std::sqrt(2.0 * 6.0 / kNumDraws);  // 95 % of chi-square, as a normal distribution
  EXPECT_NEAR(MeanNees({.num_rounds = 1}, kNumDraws, false), 6.0, band);
  // Rounds of sorting lose the twentieth of good observations that chi-square calls wrong, and those that are left look
  // better than they are: (1 - 0.05) / 0.80, a fifth, in the limit of many rounds.
  EXPECT_NEAR(MeanNees({}, kNumDraws, false), 6.0, band + 6.0 * 0.19);
  EXPECT_GT(MeanNees({}, kNumDraws, true), 5.0 * 6.0) << "depths that are taken as exact: far too sure of itself";
}

// What a dozen points of this depth, each known up to a share of its distance, say of the pose.
Eigen::Matrix<double, 6, 6> InformationOfPoints(double depth, double relative_sigma) {
  std::vector<PoseObservation> observations;
  for (const double x : {-0.3, -0.1, 0.2, 0.3}) {
    for (const double y : {-0.2, 0.0, 0.1}) {
      const Eigen::Vector3d point = depth * Eigen::Vector3d(x, y, 1.0);
      observations.push_back({point, -relative_sigma * point, SeePoint(point, false)});
    }
  }
  return OptimizePose(MakeCamera(), 0.0, observations, {}, {}).information;
}

// What more iterations would change is far below what the observations know.
TEST(OptimizePose, EndsWithinAHundredthOfASigma) {
  const Rigid3 truth{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  std::mt19937_64 generator(11);
  std::normal_distribution<double> noise_px(0.0, 1.0);
  std::vector<PoseObservation> observations;
  for (const Eigen::Vector3d& point : MakePoints(Scene::kGeneral, truth, 300)) {
    observations.push_back({.point_in_world = point, .seen = SeePoint(truth * point, false)});
    observations.back().seen.pixel_px += Eigen::Vector2d(noise_px(generator), noise_px(generator));
  }
  const PoseOptimizationOptions exhaustive{.max_iterations = 100, .min_step_sigmas = 0.0};
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), kViewBaseline, observations, truth, {});
  const PoseOptimizationResult limit = OptimizePose(MakeCamera(), kViewBaseline, observations, truth, exhaustive);
  ASSERT_EQ(result.is_inlier, limit.is_inlier);
  const Rigid3 rest = limit.camera_from_world * result.camera_from_world.Inverse();
  Eigen::Matrix<double, 6, 1> step;
  step << rest.translation, LogSO3(rest.rotation);
  EXPECT_LT(std::sqrt(step.dot(result.information * step)), 0.01);
}

TEST(OptimizePose, AFarPointHoldsTheRotationAndSaysLittleOfTheTranslation) {
  const Eigen::Matrix<double, 6, 6> near = InformationOfPoints(5.0, 0.02), far = InformationOfPoints(500.0, 1.0);
  for (int axis = 3; axis < 6; ++axis) EXPECT_GT(far(axis, axis), 0.9 * near(axis, axis)) << axis;
  for (int axis = 0; axis < 3; ++axis) EXPECT_LT(far(axis, axis), 1e-3 * near(axis, axis)) << axis;
}

TEST(OptimizePose, TooFewPointsLeaveThePose) {
  const Rigid3 guess{ExpSO3({0.02, -0.1, 0.03}), {0.4, -0.2, 0.6}};
  const PoseOptimizationResult result = OptimizePose(MakeCamera(), 0.0, {}, guess, {});
  EXPECT_EQ(result.num_inliers, 0);
  EXPECT_EQ(result.camera_from_world.translation, guess.translation);
}

}  // namespace
}  // namespace tessera
