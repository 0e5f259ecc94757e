#include "optimization/bundle_costs.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace tessera {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// d(left perturbation of camera_from_world) / d(tangent). With t = Exp(w) (t_base + v):
//   w' = J dw,   v' + w' x t = dt = w' x t + Exp(w) dv   =>   v' = Exp(w) dv
Matrix6d PerturbationByTangent(const MovingPose& pose) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = pose.turn;
  m.bottomRightCorner<3, 3>() = pose.left_jacobian;
  return m;
}

// Writes the columns of `by_tangent` (rows x 6) into Ceres' row-major blocks of kBlock columns; null: not wanted.
template <int kBlock, int kRows>
void WriteBlocks(const Eigen::Matrix<double, kRows, 6>& by_tangent, double** blocks) {
  for (int i = 0; i < 6 / kBlock; ++i) {
    if (blocks[i] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, kRows, kBlock, Eigen::RowMajor>> block(blocks[i]);
      block = by_tangent.template middleCols<kBlock>(i * kBlock);
    }
  }
}

}  // namespace

Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& omega_rad) {
  // J = I + (1 - cos a)/a^2 [w]x + (a - sin a)/a^3 [w]x^2; Taylor series where the quotients would lose digits.
  const double angle_squared = omega_rad.squaredNorm();
  const double angle = std::sqrt(angle_squared);
  const bool is_small = angle < 1e-3;
  const double first = is_small ? 0.5 - angle_squared / 24.0 : (1.0 - std::cos(angle)) / angle_squared;
  const double second =
      is_small ? 1.0 / 6.0 - angle_squared / 120.0 : (angle - std::sin(angle)) / (angle_squared * angle);
  const Eigen::Matrix3d skew = Skew(omega_rad);
  return Eigen::Matrix3d::Identity() + first * skew + second * skew * skew;
}

Rigid3 MoveBy(const Rigid3& camera_from_world, const Vector6d& tangent) {
  const Eigen::Quaterniond turn = ExpSO3(tangent.tail<3>());
  return {(turn * camera_from_world.rotation).normalized(), turn * (camera_from_world.translation + tangent.head<3>())};
}

void MovingPose::Update() {
  const Rigid3 pose = CameraFromWorld();
  rotation = pose.rotation.toRotationMatrix();
  translation = pose.translation;
  const Eigen::Map<const Eigen::Vector3d> w(tangent + 3);
  turn = ExpSO3(w).toRotationMatrix();
  left_jacobian = LeftJacobianSO3(w);
}

Rigid3 MovingPose::CameraFromWorld() const { return MoveBy(base, Eigen::Map<const Vector6d>(tangent)); }

void PoseUpdater::PrepareForEvaluation(bool /*evaluate_jacobians*/, bool new_evaluation_point) {
  if (new_evaluation_point) {
    for (MovingPose& pose : poses_) {
      pose.Update();
    }
  }
}

template <int kRows, int... kPoseBlocks>
bool ReprojectionCost<kRows, kPoseBlocks...>::Evaluate(double const* const* parameters, double* residuals,
                                                       double** jacobians) const {
  constexpr int kBlock = 6 / sizeof...(kPoseBlocks);
  Eigen::Map<Eigen::Matrix<double, kRows, 1>> residual(residuals);
  const Eigen::Vector3d point_in_camera =
      pose_.rotation * Eigen::Map<const Eigen::Vector3d>(parameters[0]) + pose_.translation;
  const bool is_behind = point_in_camera.z() < kMinDepth;
  Reprojection r;
  if (is_behind) {
    r.residual.setConstant(kBehindResidual);
  } else if (jacobians == nullptr) {
    r.residual = ReprojectionResidual(problem_.calibration, problem_.baseline_m, point_in_camera, seen_);
  } else {
    r = Reproject(problem_.calibration, problem_.baseline_m, point_in_camera, seen_);
  }
  residual = r.residual.template head<kRows>();
  if (jacobians == nullptr) {
    return true;
  }
  // d(point_in_camera): by the point, R; by v, Exp(w); by w, -[point_in_camera]x J.
  const Eigen::Matrix<double, kRows, 3> by_camera = r.by_point.template topRows<kRows>();
  if (jacobians[0] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>> by_point(jacobians[0]);
    by_point.noalias() = by_camera.lazyProduct(pose_.rotation);
  }
  if (jacobians[1] != nullptr) {
    Eigen::Matrix<double, kRows, 6> by_tangent;
    by_tangent.template leftCols<3>() = by_camera.lazyProduct(pose_.turn);
    Eigen::Matrix<double, kRows, 3> by_rotation;  // row' * -[p]x = (p x row)'
    for (int i = 0; i < kRows; ++i) {
      by_rotation.row(i) = point_in_camera.cross(by_camera.row(i).transpose()).transpose();
    }
    by_tangent.template rightCols<3>() = by_rotation.lazyProduct(pose_.left_jacobian);
    WriteBlocks<kBlock, kRows>(by_tangent, jacobians + 1);
  }
  return true;
}

RelativePoseTerm::RelativePoseTerm(const RelativePoseConstraint& constraint)
    : from_from_to_(constraint.to_from_from.Inverse()),
      square_root_information_(constraint.information.llt().matrixU()) {}

Vector6d RelativePoseTerm::Residual(const Rigid3& from, const Rigid3& to) const {
  const Rigid3 error = to * from.Inverse() * from_from_to_;
  Vector6d r;
  r << error.translation, LogSO3(error.rotation);
  return square_root_information_ * r;
}

RelativePoseTerm::Linear RelativePoseTerm::Linearize(const Rigid3& from, const Rigid3& to) const {
  const Rigid3 to_from_from = to * from.Inverse();
  const Rigid3 error = to_from_from * from_from_to_;
  Vector6d r;
  r << error.translation, LogSO3(error.rotation);
  // A left perturbation (v', w') of `error`: r_v' = Exp(w') r_v + v',  Exp(r_w') = Exp(w') Exp(r_w).
  Matrix6d by_error = Matrix6d::Identity();
  by_error.topRightCorner<3, 3>() = -Skew(error.translation);
  by_error.bottomRightCorner<3, 3>() = LeftJacobianSO3(r.tail<3>()).inverse();
  by_error = square_root_information_ * by_error;
  // One of `to` is one of `error`; one of `from` arrives there inverted and seen through to_from_from (adjoint).
  const Eigen::Matrix3d rotation = to_from_from.rotation.toRotationMatrix();
  Matrix6d minus_adjoint = Matrix6d::Zero();
  minus_adjoint.topLeftCorner<3, 3>() = -rotation;
  minus_adjoint.topRightCorner<3, 3>() = -Skew(to_from_from.translation) * rotation;
  minus_adjoint.bottomRightCorner<3, 3>() = -rotation;
  return {square_root_information_ * r, by_error * minus_adjoint, by_error};
}

template <int kBlock, int... kPoseBlocks>
bool RelativePoseCost<kBlock, kPoseBlocks...>::Evaluate(double const* const* /*parameters*/, double* residuals,
                                                        double** jacobians) const {
  Eigen::Map<Vector6d> residual(residuals);
  if (jacobians == nullptr) {
    residual = term_.Residual(from_.CameraFromWorld(), to_.CameraFromWorld());
    return true;
  }
  const RelativePoseTerm::Linear linear = term_.Linearize(from_.CameraFromWorld(), to_.CameraFromWorld());
  residual = linear.residual;
  WriteBlocks<kBlock, 6>(linear.by_from * PerturbationByTangent(from_), jacobians);
  WriteBlocks<kBlock, 6>(linear.by_to * PerturbationByTangent(to_), jacobians + 6 / kBlock);
  return true;
}

template class ReprojectionCost<2, 6>;
template class ReprojectionCost<3, 3, 3>;
template class RelativePoseCost<6, 6>;
template class RelativePoseCost<3, 3, 3, 3>;

}  // namespace tessera
