#include "geometry/body_state.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera {
namespace {

Rigid3 Pose(double angle_rad, const Eigen::Vector3d& axis, const Eigen::Vector3d& translation) {
  return {ExpSO3(angle_rad * axis.normalized()), translation};
}

const Rigid3 kBaseFromCamera = Rigid3{ForwardLeftUpFromCamera().rotation, {0.3, 0.0, 0.12}};

TEST(BodyState, TheWorldIsTheBaseAtTheOriginOfTheMap) {
  const Rigid3 at_start = PoseOfBase(Rigid3::Identity(), kBaseFromCamera);
  EXPECT_LT(at_start.translation.norm(), 1e-12);
  EXPECT_LT(LogSO3(at_start.rotation).norm(), 1e-12);
}

TEST(BodyState, WhatIsAheadOfTheCameraIsAlongX) {
  const Rigid3 ahead = PoseOfBase(Pose(0.0, {0, 0, 1}, {0.0, 0.0, 2.0}), kBaseFromCamera);
  EXPECT_LT((ahead.translation - Eigen::Vector3d(2.0, 0.0, 0.0)).norm(), 1e-12);
  const Rigid3 below = PoseOfBase(Pose(0.0, {0, 0, 1}, {0.0, 1.5, 0.0}), kBaseFromCamera);
  EXPECT_LT((below.translation - Eigen::Vector3d(0.0, 0.0, -1.5)).norm(), 1e-12);
}

TEST(BodyState, ABodyThatTurnsOnTheSpotMovesTheCameraAhead) {
  // The base turns left by 90 degrees: the camera, 0.3 m ahead of it, goes around it.
  const Rigid3 base_turned = Pose(0.5 * M_PI, {0, 0, 1}, {0.0, 0.0, 0.0});
  const Rigid3 world_from_camera = kBaseFromCamera.Inverse() * base_turned * kBaseFromCamera;
  EXPECT_GT(world_from_camera.translation.norm(), 0.3);
  const Rigid3 base = PoseOfBase(world_from_camera, kBaseFromCamera);
  EXPECT_LT(base.translation.norm(), 1e-12);
  EXPECT_LT((LogSO3(base.rotation) - Eigen::Vector3d(0.0, 0.0, 0.5 * M_PI)).norm(), 1e-12);
}

// Small errors of the camera's pose, drawn with its covariance, are those of the base that its covariance tells.
TEST(BodyState, TheCovarianceOfTheBaseIsThatOfItsErrors) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  Matrix6d factor;
  for (int i = 0; i < factor.size(); ++i) factor(i) = 1e-4 * normal(generator);
  BodyState camera{.world_from_base = Pose(0.7, {1, 2, 3}, {4, 5, 6})};
  camera.covariance = factor * factor.transpose();
  camera.has_covariance = true;
  const BodyState base = StateOfBase(camera, kBaseFromCamera);
  ASSERT_TRUE(base.has_covariance);
  Matrix6d sum = Matrix6d::Zero();
  constexpr int kNum = 20'000;
  for (int i = 0; i < kNum; ++i) {
    Eigen::Matrix<double, 6, 1> white;
    for (double& number : white) number = normal(generator);
    const Eigen::Matrix<double, 6, 1> delta = factor * white;
    const Rigid3 moved = camera.world_from_base * Rigid3{ExpSO3(delta.tail<3>()), delta.head<3>()};
    const Rigid3 error = base.world_from_base.Inverse() * PoseOfBase(moved, kBaseFromCamera);
    Eigen::Matrix<double, 6, 1> of_base;
    of_base << error.translation, LogSO3(error.rotation);
    sum += of_base * of_base.transpose();
  }
  const Matrix6d drawn = sum / kNum;
  EXPECT_LT((drawn - base.covariance).norm(), 0.03 * base.covariance.norm());
}

TEST(BodyState, VelocitiesAreThoseOfTheBase) {
  // Turning left on the spot at 1 rad/s: the camera ahead of the base moves to its left (-x of the camera).
  BodyState camera;
  camera.motion = {.velocity = {-0.3, 0.0, 0.0}, .turn_rate = {0.0, -1.0, 0.0}};
  camera.has_motion = true;
  const BodyState base = StateOfBase(camera, kBaseFromCamera);
  ASSERT_TRUE(base.has_motion);
  EXPECT_LT(base.motion.velocity.norm(), 1e-12);
  EXPECT_LT((base.motion.turn_rate - Eigen::Vector3d(0.0, 0.0, 1.0)).norm(), 1e-12);
}

}  // namespace
}  // namespace tessera
