#include "geometry/epipolar.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "support/matchers.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

const Rigid3 kMotion{ExpSO3({0.02, -0.08, 0.01}), Eigen::Vector3d(0.9, 0.1, -0.3).normalized()};

std::vector<RayPair> Rays(Scene scene, const Rigid3& motion, size_t num) {
  const CameraCalibration camera = MakeCamera();
  std::vector<RayPair> rays;
  for (const PixelPair& pair : MakePairs(MakePoints(scene, motion, num), motion, 0.0, 0)) {
    rays.push_back({camera.Ray(pair.first_px), camera.Ray(pair.second_px)});
  }
  return rays;
}

// The closest of the motions to kMotion.
Rigid3 Closest(const std::vector<Rigid3>& motions) {
  const auto error = [](const Rigid3& motion) {
    return motion.rotation.angularDistance(kMotion.rotation) + (motion.translation - kMotion.translation).norm();
  };
  return *std::min_element(motions.begin(), motions.end(),
                           [&](const Rigid3& a, const Rigid3& b) { return error(a) < error(b); });
}

TEST(Essential, HoldsForEveryPairOfTheMotion) {
  const Eigen::Matrix3d essential = EssentialFromMotion(kMotion);
  for (const RayPair& pair : Rays(Scene::kGeneral, kMotion, 50)) {
    EXPECT_NEAR(pair.second.dot(essential * pair.first), 0.0, 1e-12);
    EXPECT_NEAR(SampsonDistance(essential, pair), 0.0, 1e-12);
  }
}

TEST(Essential, OfEightPairsGivesBackTheMotion) {
  const auto essential = EssentialFromPairs(Rays(Scene::kGeneral, kMotion, 8));
  ASSERT_TRUE(essential.has_value());
  const std::vector<Rigid3> motions = MotionsFromEssential(*essential);
  EXPECT_EQ(motions.size(), 4U);
  EXPECT_THAT(Closest(motions), IsNear(kMotion, 1e-6));
}

TEST(Essential, IsNotFixedByPairsOfAPlane) {
  EXPECT_FALSE(EssentialFromPairs(Rays(Scene::kPlane, kMotion, 30)).has_value());
}

TEST(Homography, OfAPlaneMapsItsPairsAndGivesBackTheMotion) {
  const std::vector<RayPair> rays = Rays(Scene::kPlane, kMotion, 20);
  const auto homography = HomographyFromPairs(rays);
  ASSERT_TRUE(homography.has_value());
  for (const RayPair& pair : rays) EXPECT_NEAR(TransferErrorSquared(*homography, pair), 0.0, 1e-12);
  EXPECT_THAT(Closest(MotionsFromHomography(*homography)), IsNear(kMotion, 1e-6));
}

TEST(Homography, OfAPureRotationAllowsNoMotion) {
  const Rigid3 turn{kMotion.rotation, Eigen::Vector3d::Zero()};
  const auto homography = HomographyFromPairs(Rays(Scene::kGeneral, turn, 20));
  ASSERT_TRUE(homography.has_value());
  EXPECT_TRUE(MotionsFromHomography(*homography).empty());
}

// To first order, the distance is what one of the pixels must move.
TEST(SampsonDistance, IsTheDistanceFromTheNearestAllowedPair) {
  const Eigen::Matrix3d essential = EssentialFromMotion(kMotion);
  RayPair pair = Rays(Scene::kGeneral, kMotion, 1)[0];
  const Eigen::Vector3d line = essential * pair.first;
  const Eigen::Vector2d across = line.head<2>().normalized();
  pair.second.head<2>() += 1e-4 * across;
  const double share =
      line.head<2>().norm() / std::hypot(line.head<2>().norm(), (essential.transpose() * pair.second).head<2>().norm());
  EXPECT_NEAR(std::abs(SampsonDistance(essential, pair)), 1e-4 * share, 1e-7);
}

// Without pairs the prior alone counts; with many it hardly does.
TEST(RefineMotion, APriorFillsInWhatPairsLeaveOpen) {
  const Rigid3 motion{ExpSO3({0.0, 0.2, 0.0}), Eigen::Vector3d(0.1, 0.0, -1.0).normalized()};
  const DirectionPrior prior{{0.3, 0.0, 1.0}, 0.1};
  const RefinedMotion by_prior = RefineMotion({}, motion, 0.003, &prior, 0.001);
  EXPECT_LT((by_prior.second_from_first.translation - prior.DirectionFor(motion.rotation)).norm(), 1e-6);
  EXPECT_NEAR(by_prior.information(4, 4), 1e-4, 1e-12);
  const auto rays = Rays(Scene::kGeneral, motion, 100);
  const RefinedMotion by_pairs = RefineMotion(rays, motion, 0.003, &prior, 0.001);
  EXPECT_LT((by_pairs.second_from_first.translation - motion.translation).norm(), 0.005);
}

TEST(DirectionPrior, IsTheChordOfTheTurn) {
  // A camera that goes ahead while it turns by 0.4 to the right ends up to the right of ahead by half of that.
  const DirectionPrior prior{{0.0, 0.0, 2.0}, 0.1};
  const Rigid3 second_from_first{ExpSO3({0.0, -0.4, 0.0}), prior.DirectionFor(ExpSO3({0.0, -0.4, 0.0}))};
  const Eigen::Vector3d way_in_first = second_from_first.Inverse().translation;
  EXPECT_NEAR(std::atan2(way_in_first.x(), way_in_first.z()), 0.2, 1e-12);
}

TEST(RefineMotion, FindsTheMotionFromAWrongStart) {
  const std::vector<RayPair> rays = Rays(Scene::kGeneral, kMotion, 100);
  const Rigid3 start{kMotion.rotation * ExpSO3({0.01, 0.01, -0.01}), {0.95, 0.05, -0.25}};
  const RefinedMotion refined = RefineMotion(rays, start, 0.003);
  EXPECT_THAT(refined.second_from_first, IsNear(kMotion, 1e-6));
}

TEST(DirectionSigma, GrowsWithTheNoiseAndAsTheMotionShrinks) {
  const auto sigma = [](double length, double noise) {
    const Rigid3 motion{kMotion.rotation, length * kMotion.translation};
    return DirectionSigma(RefineMotion(Rays(Scene::kGeneral, motion, 100), motion, 0.003), noise);
  };
  EXPECT_NEAR(sigma(1.0, 0.002) / sigma(1.0, 0.001), 2.0, 1e-6);
  EXPECT_GT(sigma(0.1, 0.001), 3.0 * sigma(1.0, 0.001));
}

TEST(DirectionSigma, IsInfiniteWherePairsDoNotFixIt) {
  EXPECT_TRUE(std::isinf(DirectionSigma(RefinedMotion{kMotion}, 0.001)));
}

}  // namespace
}  // namespace tessera
