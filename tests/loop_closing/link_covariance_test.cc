// What a map knows of the links between its keyframes.
#include "loop_closing/link_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <memory>
#include <vector>

#include "map/map_editor.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

constexpr int kNumKeyframes = 12, kSlip = 6;

struct WorldOptions {
  double depth = 10.0;        // of the nearest points; the farthest are twice as far
  double unit = 1.0;          // of the map
  double step_factor = 1.0;   // of the steps from keyframe kSlip on
  double depth_factor = 1.0;  // of the points that are first seen from there on
};

// A camera that moves sideways by 0.5 m every 0.4 s. From keyframe kSlip on it sees other points.
class World {
 public:
  explicit World(const WorldOptions& options) : options_(options) {
    for (int k = 0; k < kNumKeyframes; ++k) {
      if (k > 0) x_ += 0.5 * options.unit * (k > kSlip ? options.step_factor : 1.0);
      AddKeyframe(k);
    }
  }

  std::vector<Matrix7> Covariances() const {
    std::vector<KeyframeId> part;
    std::vector<KeyframePair> links;
    for (int k = 0; k < kNumKeyframes; ++k) part.push_back({k});
    for (int k = 1; k < kNumKeyframes; ++k) links.push_back({{k - 1}, {k}});
    return LinkCovariances(map_, part, links, MedianDepthsOf(map_, part));
  }

  // As adjustments do with false points.
  void MoveOnePointBehindAllCameras() {
    MapEditor editor(map_);
    Landmark landmark = *map_.FindLandmark(old_points_.front());
    landmark.position_in_world.z() *= -1.0;
    editor.ChangeLandmark(old_points_.front(), landmark);
    (void)editor.Finish({kNumKeyframes - 1});
  }

 private:
  void AddKeyframe(int k) {
    auto features = std::make_shared<FeatureFrame>();
    features->frame = {k};
    features->utime_us = 400'000 * k;
    CameraCalibration& camera = features->calibration;
    camera.width_px = 1000;
    camera.height_px = 500;
    camera.fx_px = camera.fy_px = 500.0;
    camera.cx_px = 500.0;
    camera.cy_px = 250.0;
    MapEditor editor(map_);
    const Rigid3 pose{Eigen::Quaterniond::Identity(), {x_, 0.0, 0.0}};
    std::vector<std::vector<LandmarkId>*> seen;
    if (k <= kSlip + 1) seen.push_back(&old_points_);
    if (k >= kSlip - 1) seen.push_back(&new_points_);
    for (std::vector<LandmarkId>* points : seen) {
      if (points->empty()) Create(*points, points == &new_points_ ? options_.depth_factor : 1.0, editor);
    }
    for (const std::vector<LandmarkId>* points : seen) {
      for (const LandmarkId id : *points) {
        const Eigen::Vector3d point = pose.Inverse() * map_.FindLandmark(id)->position_in_world;
        const Eigen::Vector2d pixel = camera.Project(point);
        features->keypoints.push_back({.x_px = static_cast<float>(pixel.x()), .y_px = static_cast<float>(pixel.y())});
        features->descriptors.emplace_back();
      }
    }
    editor.AddKeyframe({k}, {k - 1}, Sim3::From(pose), features);
    int32_t keypoint = 0;
    for (const std::vector<LandmarkId>* points : seen) {
      for (const LandmarkId id : *points) {
        editor.AddObservation(id, {{k}, keypoint++});
        editor.ChangeLandmark(id, DescribeMovedLandmark(map_, id));
      }
    }
    (void)editor.Finish({k});
  }

  void Create(std::vector<LandmarkId>& points, double factor, MapEditor& editor) const {
    for (int i = 0; i < 60; ++i) {
      const double z = options_.unit * options_.depth * factor * (1.0 + 0.1 * (i % 11));
      points.push_back(
          editor.AddLandmark({.position_in_world = {x_ + z * (0.1 * (i % 7) - 0.3), z * (0.1 * (i % 5) - 0.2), z}}));
    }
  }

  const WorldOptions options_;
  Map map_;
  double x_ = 0.0;
  std::vector<LandmarkId> old_points_, new_points_;
};

double ScaleSigma(const World& world, int newer) {
  return std::sqrt(world.Covariances()[static_cast<size_t>(newer - 1)](6, 6));
}

TEST(LinkCovariances, FarLandmarksHoldTheRotationButNeitherScaleNorTranslation) {
  const std::vector<Matrix7> near = World({.depth = 10.0}).Covariances(), far = World({.depth = 500.0}).Covariances();
  constexpr size_t kLink = 3;
  EXPECT_LT(std::sqrt(near[kLink](6, 6)), 0.05);
  EXPECT_GT(std::sqrt(far[kLink](6, 6)), 0.3);
  EXPECT_GT(far[kLink](2, 2), 100.0 * near[kLink](2, 2));
  EXPECT_LT(std::sqrt(far[kLink].block<3, 3>(3, 3).trace()), 0.01);
}

TEST(LinkCovariances, APointBehindAllOfItsObserversTellsNothing) {
  World world({});
  const std::vector<Matrix7> before = world.Covariances();
  world.MoveOnePointBehindAllCameras();
  const std::vector<Matrix7> after = world.Covariances();
  for (size_t i = 0; i < after.size(); ++i) {
    ASSERT_TRUE(after[i].allFinite()) << i;
    EXPECT_GE(after[i].trace(), 0.99 * before[i].trace()) << i;
  }
}

TEST(LinkCovariances, ArePositiveAndBounded) {
  for (const double depth : {2.0, 50.0, 1e5}) {
    const std::vector<Matrix7> covariances = World({.depth = depth}).Covariances();
    for (size_t i = 1; i + 1 < covariances.size(); ++i) {
      const Eigen::SelfAdjointEigenSolver<Matrix7> solver(covariances[i]);
      EXPECT_GT(solver.eigenvalues().minCoeff(), 0.0) << depth;
      EXPECT_LE(covariances[i](6, 6), 1.0 + 1e-9) << depth;
    }
    EXPECT_TRUE(covariances.front().isZero() && covariances.back().isZero()) << "one view has no scale of its own";
  }
}

TEST(LinkCovariances, TheMapsUnitDoesNotMatter) {
  const Matrix7 meters = World({.unit = 1.0}).Covariances()[3], other = World({.unit = 40.0}).Covariances()[3];
  Eigen::Matrix<double, 7, 1> unit = Eigen::Matrix<double, 7, 1>::Ones();
  unit.head<3>().setConstant(1.0 / 40.0);
  EXPECT_LT((unit.asDiagonal() * other * unit.asDiagonal() - meters).norm(), 1e-3 * meters.norm());
}

TEST(LinkCovariances, SpeedAndDepthThatFallTogetherAreASlipOfTheScale) {
  const World steady({}), slipped({.step_factor = 0.25, .depth_factor = 0.25}), braked({.step_factor = 0.25});
  double steady_sigma = 0.0, slipped_sigma = 0.0, braked_sigma = 0.0;
  for (int k = kSlip - 2; k <= kSlip + 2; ++k) {
    steady_sigma = std::max(steady_sigma, ScaleSigma(steady, k));
    slipped_sigma = std::max(slipped_sigma, ScaleSigma(slipped, k));
    braked_sigma = std::max(braked_sigma, ScaleSigma(braked, k));
  }
  EXPECT_GT(slipped_sigma, 0.3);
  EXPECT_LT(steady_sigma, 0.1);
  EXPECT_LT(braked_sigma, 0.2);
}

}  // namespace
}  // namespace tessera
