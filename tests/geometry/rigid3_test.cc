#include "geometry/rigid3.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace tessera {
namespace {

Eigen::Vector3d RandomVector(std::mt19937_64& generator, double scale) {
  std::uniform_real_distribution<double> uniform(-scale, scale);
  const double x = uniform(generator), y = uniform(generator), z = uniform(generator);
  return {x, y, z};
}

Rigid3 RandomRigid(std::mt19937_64& generator) {
  return {ExpSO3(RandomVector(generator, 1.5)), RandomVector(generator, 10.0)};
}

double Distance(const Rigid3& a, const Rigid3& b) { return (a.Matrix() - b.Matrix()).norm(); }

TEST(Rigid3, IsAGroup) {
  std::mt19937_64 generator(1);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 a = RandomRigid(generator), b = RandomRigid(generator), c = RandomRigid(generator);
    const Eigen::Vector3d point = RandomVector(generator, 5.0);
    EXPECT_LT(Distance((a * b) * c, a * (b * c)), 1e-12);
    EXPECT_LT(Distance(a * a.Inverse(), Rigid3::Identity()), 1e-12);
    EXPECT_LT(Distance(a.Inverse() * a, Rigid3::Identity()), 1e-12);
    EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-12);
  }
}

TEST(Sim3, IsAGroup) {
  std::mt19937_64 generator(2);
  for (int i = 0; i < 100; ++i) {
    const Rigid3 ra = RandomRigid(generator), rb = RandomRigid(generator);
    const Sim3 a{0.5 + 0.02 * i, ra.rotation, ra.translation}, b{2.0, rb.rotation, rb.translation};
    const Eigen::Vector3d point = RandomVector(generator, 5.0);
    EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-11);
    EXPECT_LT(((a * a.Inverse()) * point - point).norm(), 1e-11);
  }
}

TEST(SO3, LogInvertsExp) {
  std::mt19937_64 generator(3);
  for (const double scale : {1e-12, 1e-8, 1e-5, 1e-3, 0.1, 1.0, 1.8}) {
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d omega = RandomVector(generator, scale);
      EXPECT_LT((LogSO3(ExpSO3(omega)) - omega).norm(), 1e-12 + 1e-9 * omega.norm()) << omega.transpose();
    }
  }
  const Eigen::Vector3d half_turn(0.0, std::numbers::pi, 0.0);
  EXPECT_NEAR(LogSO3(ExpSO3(half_turn)).norm(), std::numbers::pi, 1e-12);
}

TEST(Retract, ZeroChangesNothingAndSmallStepsAdd) {
  std::mt19937_64 generator(4);
  const Rigid3 a = RandomRigid(generator);
  EXPECT_LT(Distance(Retract(a, Eigen::Matrix<double, 6, 1>::Zero()), a), 1e-14);
  Eigen::Matrix<double, 6, 1> step;
  step << 1e-7, 2e-7, -1e-7, 3e-7, 1e-7, -2e-7;
  EXPECT_LT(Distance(Retract(Retract(a, step), step), Retract(a, 2.0 * step)), 1e-11);
}

TEST(RetractSim3, TangentOfInvertsItAndZeroKeepsTheScaleToTheBit) {
  std::mt19937_64 generator(5);
  for (int i = 0; i < 50; ++i) {
    Eigen::Matrix<double, 7, 1> tangent;
    tangent.head<3>() = RandomVector(generator, 10.0);
    tangent.segment<3>(3) = RandomVector(generator, 1.5);
    tangent(6) = 0.1 * (i - 25);
    EXPECT_LT((TangentOf(Retract(Sim3{}, tangent)) - tangent).norm(), 1e-12);
    const Sim3 moved{0.1 + 0.37 * i, ExpSO3(RandomVector(generator, 1.5)), RandomVector(generator, 10.0)};
    EXPECT_LT((TangentOf(Retract(moved, tangent) * moved.Inverse()) - tangent).norm(), 1e-11);
    tangent(6) = 0.0;
    EXPECT_EQ(Retract(moved, tangent).scale, moved.scale);
  }
}

TEST(Interpolate, MeetsBothEndsAndHalfWay) {
  const Rigid3 from = Rigid3::Identity();
  const Rigid3 to{ExpSO3({0.0, 0.4, 0.0}), {2.0, 0.0, 0.0}};
  EXPECT_LT(Distance(Interpolate(from, to, 0.0), from), 1e-14);
  EXPECT_LT(Distance(Interpolate(from, to, 1.0), to), 1e-14);
  EXPECT_LT(Distance(Interpolate(from, to, 0.5), {ExpSO3({0.0, 0.2, 0.0}), {1.0, 0.0, 0.0}}), 1e-14);
}

}  // namespace
}  // namespace tessera
