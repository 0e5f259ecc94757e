#include "geometry/similarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/sha256.h"
#include "support/matchers.h"
#include "support/other_process.h"
#include "support/synthetic_views.h"

namespace tessera {
namespace {

struct World {
  Sim3 first_from_second;
  std::vector<PointPair> pairs;
};

struct WorldOptions {
  double scale = 1.0;
  Rigid3 motion{ExpSO3({0.05, -0.3, 0.1}), {0.4, -0.2, 0.6}};  // first_from_second in the first map's unit
  size_t num_pairs = 150;
  double noise_px = 0.0;
  double depth_noise = 0.0;  // of each map's points, along the ray, as a part of the depth
  size_t outlier_step = 0;   // every outlier_step-th pair joins different points (0: none)
  double baseline_m = 0.0;   // > 0: with right columns
  uint64_t seed = 5;
};

World MakeWorld(const WorldOptions& options) {
  const CameraCalibration camera = MakeCamera();
  const Rigid3 second_from_first = options.motion.Inverse();
  const auto points = MakePoints(Scene::kGeneral, second_from_first, options.num_pairs);
  std::mt19937_64 generator(options.seed);
  std::normal_distribution<double> normal;
  const auto observe = [&](const Eigen::Vector3d& point, double baseline) {
    PixelObservation seen;
    const double u = normal(generator), v = normal(generator), right = normal(generator);
    seen.pixel_px = camera.Project(point) + options.noise_px * Eigen::Vector2d(u, v);
    if (baseline > 0.0) {
      const double disparity = camera.fx_px * baseline / point.z();
      seen.right_x_px = camera.Project(point).x() - disparity + options.noise_px * right;
    }
    return seen;
  };
  World world;
  world.first_from_second = {options.scale, options.motion.rotation, options.motion.translation};
  for (size_t i = 0; i < points.size(); ++i) {
    const bool is_wrong = options.outlier_step > 0 && i % options.outlier_step == 0;
    const Eigen::Vector3d in_second = second_from_first * points[is_wrong ? (i + 37) % points.size() : i];
    PointPair pair;
    pair.seen_first = observe(points[i], options.baseline_m);
    pair.seen_second = observe(in_second, options.baseline_m);
    pair.point_in_first = (1.0 + options.depth_noise * normal(generator)) * points[i];
    pair.point_in_second = (1.0 + options.depth_noise * normal(generator)) / options.scale * in_second;
    world.pairs.push_back(pair);
  }
  return world;
}

double ScaleError(const Sim3& a, const Sim3& b) { return std::abs(std::log(a.scale / b.scale)); }
double RotationError(const Sim3& a, const Sim3& b) { return a.rotation.angularDistance(b.rotation); }
double TranslationError(const Sim3& a, const Sim3& b) { return (a.translation - b.translation).norm(); }

bool SameBits(const SimilarityEstimate& a, const SimilarityEstimate& b) {
  return a.first_from_second.scale == b.first_from_second.scale &&
         a.first_from_second.rotation.coeffs() == b.first_from_second.rotation.coeffs() &&
         a.first_from_second.translation == b.first_from_second.translation && a.is_inlier == b.is_inlier;
}

Sim3 Disturbed(const Sim3& truth, double translation, double rotation_rad, double log_scale) {
  Eigen::Matrix<double, 7, 1> tangent;
  tangent << 1.0, -1.0, 0.5, -0.5, 1.0, 1.0, log_scale;
  tangent.head<3>() *= translation;
  tangent.segment<3>(3) *= rotation_rad;
  return Retract(truth, tangent);
}

TEST(RefineSimilarity, ExactDataGiveTheExactSimilarityAtAnyScale) {
  for (const double scale : {0.1, 0.5, 1.0, 3.0, 10.0}) {
    const World world = MakeWorld({.scale = scale});
    const Sim3 start = Disturbed(world.first_from_second, 0.01, 0.002, 0.01);
    const SimilarityEstimate estimate = RefineSimilarity(MakeCamera(), world.pairs, start, {});
    EXPECT_LT(ScaleError(estimate.first_from_second, world.first_from_second), 1e-7) << scale;
    EXPECT_LT(RotationError(estimate.first_from_second, world.first_from_second), 1e-7) << scale;
    EXPECT_LT(TranslationError(estimate.first_from_second, world.first_from_second), 1e-6) << scale;
    EXPECT_EQ(estimate.num_inliers, 150);
  }
}

TEST(RefineSimilarity, IsBetterThanItsStartUnderNoiseAndOutliers) {
  const World world = MakeWorld({.scale = 2.0, .noise_px = 0.7, .depth_noise = 0.02, .outlier_step = 3});
  const Sim3 start = Disturbed(world.first_from_second, 0.03, 0.003, 0.02);
  const SimilarityEstimate estimate = RefineSimilarity(MakeCamera(), world.pairs, start, {});
  EXPECT_LT(ScaleError(estimate.first_from_second, world.first_from_second), 0.01);
  EXPECT_LT(RotationError(estimate.first_from_second, world.first_from_second), 0.001);
  EXPECT_LT(TranslationError(estimate.first_from_second, world.first_from_second), 0.02);
  EXPECT_GE(estimate.num_inliers, 85);  // of 100
  EXPECT_LT(estimate.rotation_sigma_rad, 0.001);
  for (size_t i = 0; i < world.pairs.size(); i += 3) EXPECT_EQ(estimate.is_inlier[i], 0) << i;
}

TEST(RefineSimilarity, CountsNothingWhereNothingFits) {
  const World world = MakeWorld({.outlier_step = 1});
  const SimilarityEstimate estimate = RefineSimilarity(MakeCamera(), world.pairs, Sim3{}, {});
  EXPECT_LT(estimate.num_inliers, 5);
  EXPECT_EQ(std::accumulate(estimate.is_inlier.begin(), estimate.is_inlier.end(), 0), estimate.num_inliers);
}

TEST(EstimateSimilarity, FindsItAmongAsManyWrongPairsAtAnyScale) {
  for (const double scale : {0.1, 0.5, 1.0, 3.0, 10.0}) {
    const World world = MakeWorld({.scale = scale, .noise_px = 0.7, .depth_noise = 0.03, .outlier_step = 2});
    const auto estimate = EstimateSimilarity(MakeCamera(), world.pairs, 3, {});
    ASSERT_TRUE(estimate.has_value()) << scale;
    EXPECT_LT(ScaleError(estimate->first_from_second, world.first_from_second), 0.02) << scale;
    EXPECT_LT(RotationError(estimate->first_from_second, world.first_from_second), 0.002) << scale;
    EXPECT_LT(TranslationError(estimate->first_from_second, world.first_from_second), 0.05) << scale;
    EXPECT_GE(estimate->num_inliers, 60) << scale;  // of 75
  }
}

// As far points of mono maps are: their pixels are off by many sigmas, along the epipolar line.
TEST(EstimateSimilarity, KeepsPointsOfPoorDepth) {
  const World world = MakeWorld({.scale = 1.3, .noise_px = 0.7, .depth_noise = 0.1, .outlier_step = 2});
  const auto estimate = EstimateSimilarity(MakeCamera(), world.pairs, 3, {});
  ASSERT_TRUE(estimate.has_value());
  EXPECT_GE(estimate->num_inliers, 68);  // of 75
  EXPECT_LT(ScaleError(estimate->first_from_second, world.first_from_second), 0.05);
  EXPECT_LT(RotationError(estimate->first_from_second, world.first_from_second), 0.002);
}

// The same place again, from where it was seen first: pixels say nothing of the scale.
TEST(EstimateSimilarity, TakesTheScaleFromDepthsWhereTheCamerasCoincide) {
  for (const double scale : {0.3, 1.0, 4.0}) {
    const Rigid3 turn{ExpSO3({0.0, 0.05, 0.0}), Eigen::Vector3d::Zero()};
    const World world = MakeWorld({.scale = scale, .motion = turn, .noise_px = 0.7, .depth_noise = 0.1});
    const auto estimate = EstimateSimilarity(MakeCamera(), world.pairs, 3, {});
    ASSERT_TRUE(estimate.has_value()) << scale;
    EXPECT_LT(ScaleError(estimate->first_from_second, world.first_from_second), 0.04) << scale;
  }
}

TEST(EstimateSimilarity, WithoutScaleItIsExactlyOne) {
  for (const double baseline_m : {0.0, 0.5}) {
    const World world = MakeWorld({.noise_px = 0.7, .depth_noise = 0.02, .outlier_step = 2, .baseline_m = baseline_m});
    const SimilarityOptions options{.has_scale = false, .baseline_m = baseline_m};
    const auto estimate = EstimateSimilarity(MakeCamera(), world.pairs, 3, options);
    ASSERT_TRUE(estimate.has_value());
    EXPECT_EQ(estimate->first_from_second.scale, 1.0);
    EXPECT_LT(RotationError(estimate->first_from_second, world.first_from_second), 0.002);
    EXPECT_LT(TranslationError(estimate->first_from_second, world.first_from_second), 0.03);
    const auto refined = RefineSimilarity(MakeCamera(), world.pairs, estimate->first_from_second, options);
    EXPECT_EQ(refined.first_from_second.scale, 1.0);
  }
}

TEST(EstimateSimilarity, WithoutScaleADifferentScaleIsRefused) {
  const World world = MakeWorld({.scale = 2.0, .noise_px = 0.7, .depth_noise = 0.02});
  EXPECT_FALSE(EstimateSimilarity(MakeCamera(), world.pairs, 3, {.has_scale = false}).has_value());
}

TEST(EstimateSimilarity, WrongPairsAloneGiveNothing) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const World world = MakeWorld({.noise_px = 0.7, .outlier_step = 1, .seed = seed});
    EXPECT_FALSE(EstimateSimilarity(MakeCamera(), world.pairs, seed, {}).has_value()) << seed;
  }
}

TEST(EstimateSimilarity, PointsThatLeaveATurnOpenGiveNothing) {
  const World good = MakeWorld({.num_pairs = 60, .noise_px = 0.5});
  World line = good, place = good;
  const CameraCalibration camera = MakeCamera();
  for (size_t i = 0; i < good.pairs.size(); ++i) {
    const auto put = [&](World& world, const Eigen::Vector3d& in_first) {
      PointPair& pair = world.pairs[i];
      const Eigen::Vector2d noise = good.pairs[i].seen_first.pixel_px - camera.Project(good.pairs[i].point_in_first);
      pair.point_in_first = in_first;
      pair.point_in_second = good.first_from_second.Inverse() * in_first;
      pair.seen_first.pixel_px = camera.Project(pair.point_in_first) + noise;
      pair.seen_second.pixel_px = camera.Project(pair.point_in_second) + noise;
    };
    put(line, Eigen::Vector3d(-2.0, 0.5, 8.0) + 0.05 * static_cast<double>(i) * Eigen::Vector3d(1.0, 0.3, 0.4));
    put(place, Eigen::Vector3d(0.3, 0.2, 9.0));
  }
  EXPECT_TRUE(EstimateSimilarity(camera, good.pairs, 3, {}).has_value());
  EXPECT_FALSE(EstimateSimilarity(camera, line.pairs, 3, {}).has_value());
  EXPECT_FALSE(EstimateSimilarity(camera, place.pairs, 3, {}).has_value());
}

TEST(EstimateSimilarity, TooFewPairsOrPointsBehindGiveNothing) {
  World world = MakeWorld({.num_pairs = 19});
  EXPECT_FALSE(EstimateSimilarity(MakeCamera(), world.pairs, 3, {}).has_value());
  EXPECT_FALSE(EstimateSimilarity(MakeCamera(), {}, 3, {}).has_value());
  world = MakeWorld({});
  for (PointPair& pair : world.pairs) pair.point_in_first *= -1.0;
  EXPECT_FALSE(EstimateSimilarity(MakeCamera(), world.pairs, 3, {}).has_value());
}

TEST(EstimateSimilarity, SameSeedSameBits) {
  const World world = MakeWorld({.scale = 0.7, .noise_px = 0.7, .depth_noise = 0.05, .outlier_step = 2});
  const auto a = EstimateSimilarity(MakeCamera(), world.pairs, 9, {});
  const std::vector<double> moves_the_heap(12345, 1.0);
  const std::vector<PointPair> copy = world.pairs;
  const auto b = EstimateSimilarity(MakeCamera(), copy, 9, {});
  ASSERT_TRUE(a && b);
  EXPECT_TRUE(SameBits(*a, *b));
  const Sim3& found = a->first_from_second;
  Sha256 hash;
  for (const double value : {found.scale, found.rotation.w(), found.rotation.x(), found.rotation.y(),
                             found.rotation.z(), found.translation.x(), found.translation.y(), found.translation.z()}) {
    hash.Add(value);
  }
  ExpectSameInAnotherProcess(hash.HexDigest());
}

TEST(SimilarityOptions, OutOfRangeThrows) {
  const World world = MakeWorld({});
  EXPECT_THAT(SimilarityOptions{}.Check(), IsSuccess());
  for (const SimilarityOptions& bad :
       {SimilarityOptions{.min_inliers = 2}, SimilarityOptions{.ransac_iterations = 0},
        SimilarityOptions{.has_scale = true, .baseline_m = 0.5}, SimilarityOptions{.depth_sigma = 0.0}}) {
    EXPECT_THAT(bad.Check(), IsFailure(testing::_));
    EXPECT_THROW(EstimateSimilarity(MakeCamera(), world.pairs, 1, bad), std::invalid_argument);
    EXPECT_THROW(RefineSimilarity(MakeCamera(), world.pairs, Sim3{}, bad), std::invalid_argument);
  }
}

}  // namespace
}  // namespace tessera
