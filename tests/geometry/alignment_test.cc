#include "geometry/alignment.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace tessera {
namespace {

std::vector<Eigen::Vector3d> RandomPoints(int num, uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, 3.0);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < num; ++i) {
    const double x = normal(generator), y = normal(generator), z = normal(generator);
    points.emplace_back(x, y, z);
  }
  return points;
}

std::vector<Eigen::Vector3d> Moved(const Sim3& b_from_a, const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> moved;
  for (const Eigen::Vector3d& point : points) moved.push_back(b_from_a * point);
  return moved;
}

const Sim3 kTruth{2.5, ExpSO3({0.4, -1.9, 0.7}), {10.0, -4.0, 0.5}};

TEST(AlignPoints, RecoversASimilarity) {
  const auto a = RandomPoints(20, 1);
  const auto alignment = AlignPoints(a, Moved(kTruth, a), true);
  ASSERT_TRUE(alignment.has_value());
  EXPECT_NEAR(alignment->b_from_a.scale, kTruth.scale, 1e-12);
  EXPECT_LT(alignment->b_from_a.rotation.angularDistance(kTruth.rotation), 1e-7);
  EXPECT_LT((alignment->b_from_a.translation - kTruth.translation).norm(), 1e-11);
  EXPECT_LT(alignment->rms, 1e-11);
}

TEST(AlignPoints, WithoutScaleStaysRigid) {
  const auto a = RandomPoints(20, 2);
  const auto alignment = AlignPoints(a, Moved(kTruth, a), false);
  ASSERT_TRUE(alignment.has_value());
  EXPECT_EQ(alignment->b_from_a.scale, 1.0);
  EXPECT_LT(alignment->b_from_a.rotation.angularDistance(kTruth.rotation), 1e-7);
  EXPECT_GT(alignment->rms, 1.0);
}

TEST(AlignPoints, NeverMirrors) {
  const auto a = RandomPoints(20, 3);
  std::vector<Eigen::Vector3d> mirrored = a;
  for (Eigen::Vector3d& point : mirrored) point.x() = -point.x();
  const auto alignment = AlignPoints(a, mirrored, true);
  ASSERT_TRUE(alignment.has_value());
  EXPECT_NEAR(alignment->b_from_a.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
  EXPECT_GT(alignment->rms, 0.1);
}

TEST(AlignPoints, PointsInAPlaneAreEnough) {
  auto a = RandomPoints(4, 4);
  for (Eigen::Vector3d& point : a) point.z() = 0.0;
  const auto alignment = AlignPoints(a, Moved(kTruth, a), true);
  ASSERT_TRUE(alignment.has_value());
  EXPECT_LT(alignment->b_from_a.rotation.angularDistance(kTruth.rotation), 1e-7);
}

TEST(AlignPoints, TooFewOrAllAtOnePlaceGiveNothing) {
  const auto two = RandomPoints(2, 5);
  EXPECT_FALSE(AlignPoints(two, two, true).has_value());
  const std::vector<Eigen::Vector3d> same(5, {1.0, 2.0, 3.0});
  EXPECT_FALSE(AlignPoints(same, same, true).has_value());
}

}  // namespace
}  // namespace tessera
