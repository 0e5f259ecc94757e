#include "optimization/bundle_costs.h"

#include <gtest/gtest.h>

#include <array>

#include "support/synthetic_problems.h"

namespace tessera {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Evaluates `cost` at `parameters` (one array, cut into its blocks); `poses` follow the parameters, as in a solve.
struct CostAt {
  const ceres::CostFunction& cost;
  std::vector<double>& parameters;
  std::vector<MovingPose*> poses;

  Eigen::VectorXd Residual() { return Evaluate(nullptr); }
  Eigen::MatrixXd Jacobian() {
    Eigen::MatrixXd jacobian;
    Evaluate(&jacobian);
    return jacobian;
  }
  Eigen::MatrixXd NumericJacobian() {
    constexpr double kStep = 1e-5;
    Eigen::MatrixXd jacobian(cost.num_residuals(), static_cast<Eigen::Index>(parameters.size()));
    for (size_t i = 0; i < parameters.size(); ++i) {
      const double value = parameters[i];
      parameters[i] = value + kStep;
      const Eigen::VectorXd after = Residual();
      parameters[i] = value - kStep;
      const Eigen::VectorXd before = Residual();
      parameters[i] = value;
      jacobian.col(static_cast<Eigen::Index>(i)) = (after - before) / (2.0 * kStep);
    }
    return jacobian;
  }

  Eigen::VectorXd Evaluate(Eigen::MatrixXd* jacobian) {
    for (MovingPose* pose : poses) {
      pose->Update();
    }
    std::vector<const double*> blocks;
    std::vector<std::vector<double>> jacobians;
    const double* next = parameters.data();
    for (const int size : cost.parameter_block_sizes()) {
      blocks.push_back(next);
      next += size;
      jacobians.emplace_back(static_cast<size_t>(cost.num_residuals() * size));
    }
    std::vector<double*> jacobian_blocks;
    for (std::vector<double>& block : jacobians) {
      jacobian_blocks.push_back(block.data());
    }
    Eigen::VectorXd residual(cost.num_residuals());
    EXPECT_TRUE(cost.Evaluate(blocks.data(), residual.data(), jacobian ? jacobian_blocks.data() : nullptr));
    if (jacobian != nullptr) {
      jacobian->resize(cost.num_residuals(), static_cast<Eigen::Index>(parameters.size()));
      Eigen::Index column = 0;
      for (size_t i = 0; i < jacobians.size(); ++i) {
        const int size = cost.parameter_block_sizes()[i];
        jacobian->middleCols(column, size) =
            Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
                jacobians[i].data(), cost.num_residuals(), size);
        column += size;
      }
    }
    return residual;
  }
};

void ExpectSame(const Eigen::MatrixXd& analytic, const Eigen::MatrixXd& numeric) {
  EXPECT_LT((analytic - numeric).norm(), 1e-7 * numeric.norm()) << "analytic\n" << analytic << "\nnumeric\n" << numeric;
}

MovingPose RandomPose(std::mt19937_64& generator, const double* tangent) {
  MovingPose pose;
  pose.base = {ExpSO3(UniformVector(generator, 1.0)), UniformVector(generator, 3.0)};
  pose.tangent = tangent;
  pose.Update();
  return pose;
}

// Large tangents too: the chart must be right far from where it is mostly used.
void FillTangent(std::mt19937_64& generator, double scale, double* tangent) {
  const Vector6d values = UniformTangent(generator, scale, scale);
  std::copy_n(values.data(), 6, tangent);
}

template <class Cost>
void CheckReprojectionJacobian(double share_with_right) {
  std::mt19937_64 generator(1);
  for (const double scale : {0.0, 1e-6, 1e-3, 0.1, 1.0}) {
    for (int i = 0; i < 20; ++i) {
      BundleProblem problem;
      problem.calibration = SyntheticCamera();
      problem.baseline_m = 0.5;
      std::vector<double> parameters(9);
      FillTangent(generator, scale, parameters.data() + 3);
      MovingPose pose = RandomPose(generator, parameters.data() + 3);
      const Eigen::Vector3d in_camera = UniformVector(generator, 2.0) + 6.0 * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d position = pose.CameraFromWorld().Inverse() * in_camera;
      std::copy_n(position.data(), 3, parameters.data());
      PixelObservation seen = Observe(problem, in_camera, i < 20 * share_with_right);
      seen.pixel_px += Eigen::Vector2d(3.0, -2.0);
      seen.sigma_px = 1.44;
      CostAt at{Cost(problem, seen, pose), parameters, {&pose}};
      ExpectSame(at.Jacobian(), at.NumericJacobian());
      EXPECT_NEAR(at.Residual()[0], -3.0 / 1.44, 1e-9);
      EXPECT_NEAR(at.Residual()[1], 2.0 / 1.44, 1e-9);
    }
  }
}

TEST(LeftJacobian, MovesASmallRotationThroughExp) {
  std::mt19937_64 generator(2);
  for (const double scale : {1e-9, 1e-4, 1e-3, 0.1, 1.0}) {
    const Eigen::Vector3d w = UniformVector(generator, scale), dw = UniformVector(generator, 1e-6);
    const Eigen::Quaterniond moved = ExpSO3(LeftJacobianSO3(w) * dw) * ExpSO3(w);
    EXPECT_LT((LogSO3(moved) - (w + dw)).norm(), 1e-11) << scale;
  }
}

TEST(MonoReprojectionCost, JacobianIsTheNumericOne) { CheckReprojectionJacobian<MonoReprojectionCost>(0.0); }

TEST(StereoReprojectionCost, JacobianIsTheNumericOneWithAndWithoutRightColumn) {
  CheckReprojectionJacobian<StereoReprojectionCost>(0.5);
}

TEST(StereoReprojectionCost, ThirdRowIsTheRightColumn) {
  std::mt19937_64 generator(3);
  BundleProblem problem;
  problem.calibration = SyntheticCamera();
  problem.baseline_m = 0.5;
  std::vector<double> parameters{0.3, -0.2, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  MovingPose pose{Rigid3::Identity(), parameters.data() + 3, {}, {}, {}, {}};
  PixelObservation seen = Observe(problem, {0.3, -0.2, 5.0}, true);
  seen.right_x_px -= 4.0;
  seen.sigma_px = 2.0;
  CostAt at{StereoReprojectionCost(problem, seen, pose), parameters, {&pose}};
  EXPECT_LT((at.Residual() - Eigen::Vector3d(0.0, 0.0, 2.0)).norm(), 1e-12);
}

TEST(ReprojectionCost, IsFiniteAndFlatBehindTheCamera) {
  for (const double z : {-3.0, 0.0, 1e-300}) {
    BundleProblem problem;
    problem.calibration = SyntheticCamera();
    std::vector<double> parameters{0.0, 0.0, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    MovingPose pose{Rigid3::Identity(), parameters.data() + 3, {}, {}, {}, {}};
    CostAt at{MonoReprojectionCost(problem, PixelObservation{}, pose), parameters, {&pose}};
    EXPECT_GT(at.Residual().norm(), 10.0);
    EXPECT_TRUE(at.Residual().allFinite());
    EXPECT_TRUE(at.Jacobian().isZero(0.0));
  }
}

template <class Cost>
void CheckRelativePoseJacobian() {
  std::mt19937_64 generator(4);
  for (const double scale : {0.0, 1e-6, 1e-3, 0.1, 0.8}) {
    std::vector<double> parameters(12);
    FillTangent(generator, scale, parameters.data());
    FillTangent(generator, scale, parameters.data() + 6);
    MovingPose from = RandomPose(generator, parameters.data());
    MovingPose to = RandomPose(generator, parameters.data() + 6);
    RelativePoseConstraint constraint;
    const Vector6d error = UniformTangent(generator, scale, scale);
    constraint.to_from_from = Retract(to.CameraFromWorld() * from.CameraFromWorld().Inverse(), error);
    const Matrix6d random = Matrix6d::Random();
    constraint.information = random * random.transpose() + Matrix6d::Identity();
    CostAt at{Cost(constraint, from, to), parameters, {&from, &to}};
    ExpectSame(at.Jacobian(), at.NumericJacobian());
  }
}

TEST(RelativePoseCost, JacobianIsTheNumericOneInBothBlockings) {
  CheckRelativePoseJacobian<WholeRelativePoseCost>();
  CheckRelativePoseJacobian<SplitRelativePoseCost>();
}

TEST(RelativePoseCost, SquaredResidualIsTheInformationOfTheTangent) {
  std::mt19937_64 generator(5);
  const std::array<double, 12> tangents{};
  MovingPose from = RandomPose(generator, tangents.data());
  MovingPose to = RandomPose(generator, tangents.data() + 6);
  Vector6d r;
  r << 0.1, -0.2, 0.3, 0.05, -0.04, 0.03;
  RelativePoseConstraint constraint;
  // to * from^-1 = Retract(to_from_from, r)
  const Rigid3 motion = to.base * from.base.Inverse();
  constraint.to_from_from = Rigid3{ExpSO3(r.tail<3>()), r.head<3>()}.Inverse() * motion;
  const Matrix6d random = Matrix6d::Random();
  constraint.information = random * random.transpose() + Matrix6d::Identity();
  std::vector<double> parameters(12, 0.0);
  CostAt at{WholeRelativePoseCost(constraint, from, to), parameters, {&from, &to}};
  EXPECT_NEAR(at.Residual().squaredNorm(), r.dot(constraint.information * r), 1e-12);
}

}  // namespace
}  // namespace tessera
