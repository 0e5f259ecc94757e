#include "geometry/absolute_pose.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/synthetic_views.h"

namespace tessera {
namespace {

const Rigid3 kTruth{ExpSO3({0.1, -0.4, 0.2}), {0.4, -0.2, 0.6}};

std::vector<PointPixel> MakeSeen(double noise_px, size_t outlier_step) {
  const auto points = MakePoints(Scene::kGeneral, kTruth, 120);
  const auto pairs = MakePairs(points, kTruth, noise_px, outlier_step);
  std::vector<PointPixel> seen;
  for (size_t i = 0; i < points.size(); ++i) seen.push_back({points[i], pairs[i].second_px, 1.0});
  return seen;
}

TEST(PosesFromThreePoints, OneOfThemIsTheTruth) {
  const auto points = MakePoints(Scene::kGeneral, kTruth, 90);
  for (size_t i = 0; i + 2 < points.size(); i += 3) {
    const std::array<Eigen::Vector3d, 3> triple = {points[i], points[i + 1], points[i + 2]};
    const auto poses = PosesFromThreePoints(triple, {kTruth * triple[0], kTruth * triple[1], kTruth * triple[2]});
    EXPECT_LE(poses.size(), 4U);
    EXPECT_TRUE(std::any_of(poses.begin(), poses.end(), [](const Rigid3& pose) {
      return (pose.translation - kTruth.translation).norm() < 1e-4;
    })) << i;
  }
}

TEST(EstimateAbsolutePose, FindsThePoseAmongWrongMatches) {
  const auto pose = EstimateAbsolutePose(MakeCamera(), MakeSeen(0.5, 2), 3, {});
  ASSERT_TRUE(pose.has_value());
  EXPECT_LT((pose->camera_from_world.translation - kTruth.translation).norm(), 0.1);
  EXPECT_LT(pose->camera_from_world.rotation.angularDistance(kTruth.rotation), 0.02);
  EXPECT_GE(pose->num_inliers, 40);
}

TEST(EstimateAbsolutePose, IsMoreExactThanThreePixels) {
  const std::vector<PointPixel> seen = MakeSeen(1.0, 2);
  double error = 0.0, error_of_three = 0.0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto pose = EstimateAbsolutePose(MakeCamera(), seen, seed, {});
    const auto of_three = EstimateAbsolutePose(MakeCamera(), seen, seed, {.max_refinements = 0});
    ASSERT_TRUE(pose.has_value() && of_three.has_value());
    EXPECT_GE(pose->num_inliers, of_three->num_inliers);
    error += (pose->camera_from_world.translation - kTruth.translation).norm();
    error_of_three += (of_three->camera_from_world.translation - kTruth.translation).norm();
  }
  EXPECT_LT(error, 0.7 * error_of_three);
}

TEST(EstimateAbsolutePose, GivesNothingWhereNothingAgrees) {
  EXPECT_FALSE(EstimateAbsolutePose(MakeCamera(), MakeSeen(0.0, 1), 3, {}).has_value());
  EXPECT_FALSE(EstimateAbsolutePose(MakeCamera(), {}, 3, {}).has_value());
}

}  // namespace
}  // namespace tessera
