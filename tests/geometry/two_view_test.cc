#include "geometry/two_view.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/synthetic_views.h"

namespace tessera {
namespace {

const Rigid3 kSideways{ExpSO3({0.01, -0.05, 0.02}), {-1.2, 0.1, 0.1}};
const Rigid3 kForward{ExpSO3({0.0, 0.02, 0.0}), {0.1, 0.0, -1.5}};

double RotationError(const Rigid3& a, const Rigid3& b) { return a.rotation.angularDistance(b.rotation); }
double DirectionError(const Rigid3& a, const Rigid3& b) {
  return std::acos(std::min(1.0, a.translation.normalized().dot(b.translation.normalized())));
}

// The motion, if it is clear.
std::optional<TwoViewResult> EstimateClear(const std::vector<PixelPair>& pairs, uint64_t seed,
                                           const TwoViewOptions& options, std::span<const Rigid3> guesses = {}) {
  auto result = EstimateTwoView(MakeCamera(), pairs, seed, options, guesses);
  return result && result->is_clear ? std::move(result) : std::nullopt;
}

std::optional<TwoViewResult> Estimate(Scene scene, const Rigid3& motion, double noise_px, size_t outlier_step) {
  const auto points = MakePoints(scene, motion, 300);
  return EstimateClear(MakePairs(points, motion, noise_px, outlier_step), 5, {});
}

// Points up to the scale that two views leave open.
void ExpectPoints(Scene scene, const Rigid3& motion, const TwoViewResult& result, double tolerance) {
  const auto points = MakePoints(scene, motion, 300);
  const double scale = motion.translation.norm();
  for (size_t i = 0; i < points.size(); ++i) {
    if (result.points[i]) {
      EXPECT_LT((scale * *result.points[i] - points[i]).norm(), tolerance * points[i].norm()) << i;
    }
  }
}

TEST(EstimateTwoView, RecoversMotionAndPointsWithoutNoise) {
  for (const Scene scene : {Scene::kGeneral, Scene::kPlane}) {
    for (const Rigid3& motion : {kSideways, kForward}) {
      const auto result = Estimate(scene, motion, 0.0, 0);
      if (scene == Scene::kPlane && !result) continue;  // a plane may allow two motions: refused, see below
      ASSERT_TRUE(result.has_value());
      EXPECT_NEAR(result->second_from_first.translation.norm(), 1.0, 1e-9);
      EXPECT_LT(RotationError(result->second_from_first, motion), 1e-6);
      EXPECT_LT(DirectionError(result->second_from_first, motion), 1e-6);
      EXPECT_GE(result->num_points, 100);
      ExpectPoints(scene, motion, *result, 1e-5);
    }
  }
}

TEST(EstimateTwoView, StandsNoiseAndWrongMatchesOnAGeneralScene) {
  for (const Rigid3& motion : {kSideways, kForward}) {
    const auto result = Estimate(Scene::kGeneral, motion, 0.5, 5);
    ASSERT_TRUE(result.has_value());
    EXPECT_LT(RotationError(result->second_from_first, motion), 0.003);
    EXPECT_LT(DirectionError(result->second_from_first, motion), 0.03);
  }
}

// A plane has a second motion that explains it as well (Faugeras & Lustman 1988), unless some of its points would stand
// behind a camera. The start is then refused or right, never wrong.
TEST(EstimateTwoView, IsRightOrRefusesOnAPlane) {
  for (const double noise_px : {0.0, 0.5}) {
    for (const Rigid3& motion : {kSideways, kForward}) {
      const auto result = Estimate(Scene::kPlane, motion, noise_px, 5);
      if (!result) continue;
      EXPECT_LT(RotationError(result->second_from_first, motion), 0.01);
      EXPECT_LT(DirectionError(result->second_from_first, motion), 0.1);
    }
  }
}

// A road beside a house front, below a sky. The front alone allows a step aside with a turn, too, which puts the sky
// near. Noise puts half of the sky behind the camera that drove ahead, and that says nothing against it.
TEST(EstimateTwoView, NoiseInTheSkySaysNothingAgainstDrivingAhead) {
  const CameraCalibration camera = MakeCamera();
  const Rigid3 ahead{ExpSO3({0.002, 0.001, 0.001}), {0.0, 0.0, -2.5}};
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 450; ++i) {
    points.push_back(1e5 * camera.Ray({20.0 + 2.67 * i, 240.0 - (37 * i) % 80}));
  }
  for (int i = 0; i < 500; ++i) {
    points.emplace_back(-6.0, -0.5 - 0.006 * ((97 * i) % 500), 9.0 + 0.05 * i);
  }
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto result = EstimateClear(MakePairs(points, ahead, 0.5, 0), seed, {});
    ASSERT_TRUE(result.has_value()) << seed;
    EXPECT_LT(RotationError(result->second_from_first, ahead), 0.01) << seed;
    EXPECT_LT(DirectionError(result->second_from_first, ahead), 0.1) << seed;
  }
}

// What the last frame showed is tried as well, and the samples need not find it again.
TEST(EstimateTwoView, AGuessStandsForSamplesThatFailed) {
  const auto pairs = MakePairs(MakePoints(Scene::kGeneral, kForward, 300), kForward, 0.5, 4);
  const Rigid3 near{ExpSO3({0.01, 0.0, 0.0}) * kForward.rotation, Eigen::Vector3d(0.1, 0.1, -1.5).normalized()};
  int num_without = 0, num_with = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const TwoViewOptions options{.ransac_iterations = 1};
    const auto result = EstimateClear(pairs, seed, options, {&near, 1});
    num_without += EstimateClear(pairs, seed, options) ? 1 : 0;
    num_with += result && DirectionError(result->second_from_first, kForward) < 0.03 ? 1 : 0;
  }
  EXPECT_LT(num_without, 5);
  EXPECT_EQ(num_with, 10);
}

// Noisy pairs of a plane leave open how much of a step aside is a turn; where the camera is expected decides that.
TEST(EstimateTwoView, AnExpectedDirectionTellsTurningFromMovingAside) {
  const Rigid3 motion{ExpSO3({0.0, -0.5, 0.0}), {0.2, 0.0, -1.1}};
  const auto pairs = MakePairs(MakePoints(Scene::kPlane, motion, 300), motion, 0.5, 5);
  const Eigen::Vector3d way = -(ExpSO3(0.5 * LogSO3(motion.rotation)).conjugate() * motion.translation);
  TwoViewOptions options{.min_rival_z = 0.0, .max_direction_sigma_rad = 0.15};
  options.prior = {ExpSO3({0.0, 0.05, 0.0}) * way, 0.1};
  const auto result = EstimateClear(pairs, 5, options);
  ASSERT_TRUE(result.has_value());
  EXPECT_LT(RotationError(result->second_from_first, motion), 0.02);
  EXPECT_LT(DirectionError(result->second_from_first, motion), 0.1);
}

TEST(EstimateTwoView, RefusesARotationOnTheSpot) {
  const Rigid3 turn{ExpSO3({0.0, 0.06, 0.0}), {0.0, 0.0, 0.0}};
  for (const Scene scene : {Scene::kGeneral, Scene::kPlane}) {
    EXPECT_FALSE(Estimate(scene, turn, 0.5, 0).has_value());
  }
}

TEST(EstimateTwoView, ACameraThatStandsStillIsNotSampled) {
  const Rigid3 still{Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.0}};
  const auto pairs = MakePairs(MakePoints(Scene::kGeneral, still, 300), still, 0.5, 0);
  EXPECT_FALSE(EstimateTwoView(MakeCamera(), pairs, 5, {}).has_value());
}

TEST(EstimateTwoView, RefusesTooLittleParallaxAndTooFewPairs) {
  const Rigid3 small{kSideways.rotation, 0.01 * kSideways.translation};
  EXPECT_FALSE(Estimate(Scene::kGeneral, small, 0.5, 0).has_value());
  const auto points = MakePoints(Scene::kGeneral, kSideways, 20);
  EXPECT_FALSE(EstimateTwoView(MakeCamera(), MakePairs(points, kSideways, 0.0, 0), 5, {}).has_value());
}

TEST(EstimateTwoView, SameSeedGivesTheSameBits) {
  const auto first = Estimate(Scene::kGeneral, kForward, 0.5, 5), second = Estimate(Scene::kGeneral, kForward, 0.5, 5);
  ASSERT_TRUE(first.has_value() && second.has_value());
  EXPECT_EQ(first->second_from_first.translation, second->second_from_first.translation);
  EXPECT_EQ(first->second_from_first.rotation.coeffs(), second->second_from_first.rotation.coeffs());
}

}  // namespace
}  // namespace tessera
