// Four observations at once give what each by itself does.
#include "geometry/pose_problem.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

namespace tessera {
namespace {

using Matrix6d = PoseProblem::Matrix6d;
using Vector6d = PoseProblem::Vector6d;

constexpr double kBaseline = 0.1;

CameraCalibration MakeCamera() {
  CameraCalibration camera;
  camera.fx_px = 500.0;
  camera.fy_px = 510.0;
  camera.cx_px = 320.0;
  camera.cy_px = 240.0;
  camera.width_px = 640;
  camera.height_px = 480;
  return camera;
}

// Points before a camera near the origin, seen to within some pixels: by one column, by two, and by a depth sensor.
std::vector<PoseObservation> MakeObservations(int num) {
  std::mt19937_64 generator(5);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  std::vector<PoseObservation> observations;
  for (int i = 0; i < num; ++i) {
    PoseObservation o;
    o.point_in_world = {2.0 * u(generator), 1.5 * u(generator), 6.0 + 3.0 * u(generator)};
    o.depth_sigma_in_world = i % 4 == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(-0.2 * o.point_in_world);
    const Eigen::Vector3d& p = o.point_in_world;
    const Eigen::Vector2d noise_px(2.0 * u(generator), 2.0 * u(generator));
    o.seen.pixel_px = MakeCamera().Project(p) + noise_px;
    o.seen.sigma_px = 1.0 + 0.2 * (i % 3);
    if (i % 3 != 0) o.seen.right_x_px = o.seen.pixel_px.x() - 500.0 * kBaseline / p.z() + u(generator);
    if (i % 3 == 2) o.seen.disparity_sigma_px = 0.3;
    observations.push_back(o);
  }
  return observations;
}

struct Sums {
  Matrix6d information = Matrix6d::Zero();
  Vector6d gradient = Vector6d::Zero();
};

// Observation by observation, all at their first depths: Schur's complement of u in the normal equations of both.
Sums OneByOne(const std::vector<PoseObservation>& observations, const Rigid3& camera_from_world) {
  Sums sums;
  for (const PoseObservation& o : observations) {
    const Eigen::Vector3d point = camera_from_world * o.point_in_world;
    const Reprojection seen = Reproject(MakeCamera(), kBaseline, point, o.seen);
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << seen.by_point, -seen.by_point * Skew(point);
    const Eigen::Vector3d by_u = seen.by_point * (camera_from_world.rotation * o.depth_sigma_in_world);
    const double huber = HuberWeight(seen.residual.squaredNorm(), Chi2Limit(o.seen.has_right()));
    const Vector6d coupling = by_pose.transpose() * by_u;
    const double curvature = 1.0 + by_u.squaredNorm();
    sums.information += huber * (by_pose.transpose() * by_pose - coupling * coupling.transpose() / curvature);
    sums.gradient += huber * (by_pose.transpose() * seen.residual - by_u.dot(seen.residual) / curvature * coupling);
  }
  return sums;
}

class PoseProblemOfSomeObservations : public testing::TestWithParam<int> {};

// Also of numbers that don't fill the last four.
TEST_P(PoseProblemOfSomeObservations, StepsAsTheirSumDoes) {
  const Rigid3 start{ExpSO3({0.01, -0.02, 0.03}), {0.05, -0.02, 0.04}};
  const CameraCalibration camera = MakeCamera();
  const std::vector<PoseObservation> observations = MakeObservations(GetParam());
  PoseProblem problem(camera, kBaseline, observations, start, nullptr);
  Matrix6d information;
  const auto step = problem.Step(start, &information);
  ASSERT_TRUE(step.has_value());
  const Sums expected = OneByOne(observations, start);
  EXPECT_LT((information - expected.information).norm(), 1e-12 * expected.information.norm());
  EXPECT_LT((expected.information * *step + expected.gradient).norm(), 1e-9 * expected.gradient.norm());
}
INSTANTIATE_TEST_SUITE_P(Numbers, PoseProblemOfSomeObservations, testing::Values(8, 9, 10, 11, 53));

TEST(PoseProblem, APriorOfTheCenterAddsItsInformation) {
  const CameraCalibration camera = MakeCamera();
  const std::vector<PoseObservation> observations = MakeObservations(12);
  const PosePrior prior{Rigid3{}, 7.0 * Eigen::Matrix3d::Identity()};
  Matrix6d without, with;
  ASSERT_TRUE(PoseProblem(camera, kBaseline, observations, {}, nullptr).Step({}, &without));
  ASSERT_TRUE(PoseProblem(camera, kBaseline, observations, {}, &prior).Step({}, &with));
  Matrix6d difference = Matrix6d::Zero();
  difference.topLeftCorner<3, 3>() = prior.information;
  EXPECT_LT((with - without - difference).norm(), 1e-9 * with.norm());
}

TEST(PoseProblem, SortsOutWhatDoesNotAgreeAndWhatStandsBehind) {
  const CameraCalibration camera = MakeCamera();
  std::vector<PoseObservation> observations = MakeObservations(13);
  for (PoseObservation& o : observations) {
    o.seen.pixel_px = camera.Project(o.point_in_world);
    o.seen.right_x_px = kNoColumn;
  }
  observations[3].seen.pixel_px.x() += 50.0;
  observations[12].point_in_world.z() = -4.0;
  PoseProblem problem(camera, kBaseline, observations, {}, nullptr);
  EXPECT_EQ(problem.Classify({}), 11);
  const std::vector<char> is_inlier = problem.is_inlier();
  ASSERT_EQ(is_inlier.size(), 13U);
  EXPECT_FALSE(is_inlier[3] || is_inlier[12]);
  EXPECT_LT(problem.rms(), 1e-9);
}

}  // namespace
}  // namespace tessera
