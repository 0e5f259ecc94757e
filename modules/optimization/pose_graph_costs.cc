#include "optimization/pose_graph_costs.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "geometry/reprojection.h"
#include "optimization/bundle_costs.h"

namespace tessera {

void MovingNode::Update() {
  const Eigen::Map<const Eigen::Vector3d> v(tangent), w(tangent + 3);
  world_from_keyframe.scale = has_scale ? base.scale * std::exp(tangent[6]) : base.scale;
  world_from_keyframe.rotation = (ExpSO3(w) * base.rotation).normalized();
  world_from_keyframe.translation = base.translation + v;
  rotation = world_from_keyframe.rotation.toRotationMatrix();
  left_jacobian = LeftJacobianSO3(w);
}

void NodeUpdater::PrepareForEvaluation(bool /*evaluate_jacobians*/, bool new_evaluation_point) {
  if (new_evaluation_point) {
    for (MovingNode& node : nodes_) node.Update();
  }
}

template <int kSize>
PoseGraphCost<kSize>::PoseGraphCost(const PoseGraphEdge& edge, const PoseGraphOptions& options, const MovingNode& from,
                                    const MovingNode& to)
    : from_from_to_(edge.to_from_from.Inverse()),
      measured_rotation_(from_from_to_.rotation.toRotationMatrix()),
      from_(from),
      to_(to) {
  Eigen::Matrix<double, 7, 1> sigma;
  sigma.head<3>().setConstant(edge.length * options.translation_sigma);
  sigma.segment<3>(3).setConstant(options.rotation_sigma_rad);
  sigma(6) = options.log_scale_sigma;
  Eigen::Matrix<double, 7, 7> covariance = edge.covariance;
  covariance.diagonal() += sigma.cwiseAbs2();
  // With covariance = L L':  |L^-1 r|^2 = r' covariance^-1 r
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> cholesky(covariance.topLeftCorner<kSize, kSize>());
  whitening_ = std::sqrt(edge.weight) * Eigen::Matrix<double, kSize, kSize>::Identity();
  cholesky.matrixL().solveInPlace(whitening_);
}

template <int kSize>
bool PoseGraphCost<kSize>::Evaluate(double const* const* /*parameters*/, double* residuals, double** jacobians) const {
  // With m = from_from_to, measured:  E = m * S_to^-1 * S_from,
  //   R_E = R_m R_to' R_from,   t_E = s_m/s_to R_m R_to' (t_from - t_to) + t_m,   s_E = s_m s_from / s_to
  const Sim3& from = from_.world_from_keyframe;
  const Sim3& to = to_.world_from_keyframe;
  const Sim3 error = from_from_to_ * (to.Inverse() * from);
  const Eigen::Matrix<double, 7, 1> tangent = TangentOf(error);
  Eigen::Map<Eigen::Matrix<double, kSize, 1>> residual(residuals);
  residual.noalias() = whitening_ * tangent.head<kSize>();
  if (jacobians == nullptr) return true;

  // With left perturbations a of rotations, R' = Exp(a) R, and Log(R_E Exp(b)) = Log(R_E) + J_r^-1 b:
  //   dt_E = T (dv_from - dv_to) + T [t_from - t_to]x a_to - T (t_from - t_to) dc_to,     T = s_m/s_to R_m R_to'
  //   dLog(R_E) = J_r^-1 R_from' (a_from - a_to),     d ln(s_E) = dc_from - dc_to,     a = J_l(w) dw
  const Eigen::Matrix3d turn = from_from_to_.scale / to.scale * (measured_rotation_ * to_.rotation.transpose());
  const Eigen::Vector3d apart = from.translation - to.translation;
  const Eigen::Matrix3d by_turn = LeftJacobianSO3(-tangent.segment<3>(3)).inverse() * from_.rotation.transpose();
  Eigen::Matrix<double, kSize, kSize> by_from = Eigen::Matrix<double, kSize, kSize>::Zero(), by_to = by_from;
  by_from.template topLeftCorner<3, 3>() = turn;
  by_to.template topLeftCorner<3, 3>() = -turn;
  by_to.template block<3, 3>(0, 3) = turn * Skew(apart) * to_.left_jacobian;
  by_from.template block<3, 3>(3, 3) = by_turn * from_.left_jacobian;
  by_to.template block<3, 3>(3, 3) = -by_turn * to_.left_jacobian;
  if constexpr (kSize == 7) {
    by_to.template block<3, 1>(0, 6) = -turn * apart;
    by_from(6, 6) = 1.0;
    by_to(6, 6) = -1.0;
  }
  using RowMajor = Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor>;
  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMajor> block(jacobians[0]);
    block.noalias() = whitening_ * by_from;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<RowMajor> block(jacobians[1]);
    block.noalias() = whitening_ * by_to;
  }
  return true;
}

template class PoseGraphCost<6>;
template class PoseGraphCost<7>;

}  // namespace tessera
