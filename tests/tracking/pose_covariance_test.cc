#include "tracking/pose_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "matching/frame_pose.h"
#include "measurement/keypoint_measurement.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr int kNumDraws = 120;
constexpr double kNoise_px = KeypointSigmaPx(SensorType::kMono);

// Moves keypoints by noise of this size on their level; `num_alike` that follow one another stand at the same corner,
// see the same point and err alike.
TrackedFrame Blurred(const SyntheticWorld& world, const TrackedFrame& frame, double sigma_px, size_t num_alike,
                     std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0.0, sigma_px);
  FeatureFrame features = frame.view->features();
  const Rigid3 camera_from_world = frame.world_from_camera.Inverse();
  const CameraCalibration& camera = world.calibration();
  std::vector<SeenPoint> points = frame.points;
  Eigen::Vector2d corner = Eigen::Vector2d::Zero();
  for (size_t i = 0; i < points.size(); ++i) {
    if (i % num_alike != 0) {
      points[i] = points[i - 1];
    } else {
      const Eigen::Vector3d at = camera_from_world * points[i].landmark.position_in_world;
      const double dx = normal(generator), dy = normal(generator);
      corner = {camera.fx_px * at.x() / at.z() + camera.cx_px + dx, camera.fy_px * at.y() / at.z() + camera.cy_px + dy};
    }
    features.keypoints[i].x_px = static_cast<float>(corner.x());
    features.keypoints[i].y_px = static_cast<float>(corner.y());
    features.keypoints[i].level = 0;
  }
  TrackedFrame blurred(ViewOf(features));
  blurred.world_from_camera = frame.world_from_camera;
  blurred.points = points;
  for (SeenPoint& point : blurred.points) point.landmark.max_distance = point.landmark.depth_sigma = 0.0;  // exact
  return blurred;
}

// e' covariance^-1 e, of an estimate that is off by e.
double Nees(const Rigid3& true_from_estimate, const Matrix6d& covariance) {
  Vector6d e;
  e << true_from_estimate.translation, LogSO3(true_from_estimate.rotation);
  return e.dot(covariance.ldlt().solve(e));
}

// Its mean over draws: 6 if the covariance is true.
double MeanNees(double sigma_px, size_t num_alike) {
  SyntheticWorld world(SensorType::kMono, 0.0, 600 * num_alike);
  const TrackedFrame exact = world.TrackedAt(3);
  std::mt19937_64 generator(5);
  double sum = 0.0;
  for (int draw = 0; draw < kNumDraws; ++draw) {
    TrackedFrame frame = Blurred(world, exact, sigma_px, num_alike, generator);
    EXPECT_GT(OptimizeFrame({}, frame), 50);
    const std::optional<PoseInfluences> influences = InfluencesOn(frame);
    if (!influences) return NAN;
    sum += Nees(frame.world_from_camera.Inverse() * exact.world_from_camera, PoseCovariance(*influences));
  }
  return sum / kNumDraws;
}

// Of the way between two frames, whose points are where the map wrongly has them. `knows`: that they are the same.
double MeanNeesOfWay(bool knows) {
  SyntheticWorld world(SensorType::kMono, 0.0, 1200);
  const TrackedFrame first = world.TrackedAt(3), second = world.TrackedAt(4);
  const Rigid3 true_way = first.world_from_camera.Inverse() * second.world_from_camera;
  std::mt19937_64 generator(6);
  std::normal_distribution<double> normal(0.0, 0.004);  // m
  double sum = 0.0;
  for (int draw = 0; draw < kNumDraws; ++draw) {
    std::map<PointId, Eigen::Vector3d> errors;
    const auto localize = [&](const TrackedFrame& exact) {
      TrackedFrame frame = Blurred(world, exact, 0.1, 1, generator);
      for (SeenPoint& point : frame.points) {
        if (!point.valid()) continue;
        const auto [error, is_new] = errors.try_emplace(point.id);
        if (is_new) error->second = {normal(generator), normal(generator), normal(generator)};
        point.landmark.position_in_world += error->second;
      }
      EXPECT_GT(OptimizeFrame({}, frame), 50);
      return frame;
    };
    const TrackedFrame reference = localize(first), frame = localize(second);
    std::optional<PoseInfluences> on_reference = InfluencesOn(reference), on_frame = InfluencesOn(frame);
    if (!on_reference || !on_frame) return NAN;
    for (PointInfluence& influence : *on_reference) influence.point = knows ? influence.point : PointId{};
    std::ranges::stable_sort(*on_reference, {}, &PointInfluence::point);
    const Rigid3 way = reference.world_from_camera.Inverse() * frame.world_from_camera;
    sum += Nees(way.Inverse() * true_way, WayCovariance(*on_reference, *on_frame, way.Inverse()));
  }
  return sum / kNumDraws;
}

// 95 % of chi-square, and the tenth by which a few hundred cells leave the covariance itself uncertain.
const double kBand = 1.96 * std::sqrt(2.0 * 6.0 / kNumDraws) + 0.6;

TEST(PoseCovariance, IsConsistent) { EXPECT_NEAR(MeanNees(kNoise_px, 1), 6.0, kBand); }

TEST(PoseCovariance, LearnsTheNoiseFromTheResiduals) { EXPECT_NEAR(MeanNees(0.1, 1), 6.0, kBand); }

TEST(PoseCovariance, CountsTheNoiseThatWasTakenOutAsOutliers) {
  EXPECT_NEAR(MeanNees(1.1 * kNoise_px, 1), 6.0, kBand);
  EXPECT_NEAR(MeanNees(1.4 * kNoise_px, 1), 6.0, kBand);
}

// Of two dimensions, the integrals have a closed form:  K = 1 - t / (e^t - 1).
TEST(PoseCovariance, KnowsWhatALimitLeavesOfTheNoise) {
  for (const double t : {1.5, 3.0, 6.0}) {
    const double kept = 1.0 - t / std::expm1(t);
    EXPECT_NEAR(KeptVariance(kept / t, 2.0), kept, 1e-4);
  }
  EXPECT_NEAR(KeptVariance(1e-4, 3.0), 1.0, 1e-3) << "nothing is cut off";
  EXPECT_NEAR(KeptVariance(0.5, 2.0), 1.0 - 1.0 / std::expm1(1.0), 1e-4) << "as much as can be told from outliers";
}

TEST(PoseCovariance, CountsKeypointsOfOneCornerOnce) { EXPECT_NEAR(MeanNees(kNoise_px, 4), 6.0, kBand); }

TEST(PoseCovariance, ErrorsThatBothEndsOfAWayShareCancel) {
  EXPECT_NEAR(MeanNeesOfWay(true), 6.0, kBand);
  EXPECT_LT(MeanNeesOfWay(false), 6.0 - kBand) << "too careful";
}

TEST(PoseCovariance, SaysNothingOfAFewPoints) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  TrackedFrame frame = world.TrackedAt(3);
  EXPECT_TRUE(InfluencesOn(frame));
  for (size_t i = 8; i < frame.points.size(); ++i) frame.points[i] = {};
  EXPECT_FALSE(InfluencesOn(frame));
}

}  // namespace
}  // namespace tessera
