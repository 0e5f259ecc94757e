#include "geometry/body_state.h"

namespace tessera {

Matrix6d AdjointOf(const Rigid3& transform) {
  const Eigen::Matrix3d rotation = transform.rotation.toRotationMatrix();
  Eigen::Matrix3d cross;
  const Eigen::Vector3d& t = transform.translation;
  cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = rotation;
  adjoint.topRightCorner<3, 3>() = cross * rotation;
  adjoint.bottomRightCorner<3, 3>() = rotation;
  return adjoint;
}

Rigid3 PoseOfBase(const Rigid3& world_from_camera, const Rigid3& base_from_camera) {
  return base_from_camera * world_from_camera * base_from_camera.Inverse();
}

BodyState StateOfBase(const BodyState& camera, const Rigid3& base_from_camera) {
  const Matrix6d adjoint = AdjointOf(base_from_camera);
  BodyState base;
  base.world_from_base = PoseOfBase(camera.world_from_base, base_from_camera);
  const Matrix6d covariance = adjoint * camera.covariance * adjoint.transpose();
  base.covariance = 0.5 * (covariance + covariance.transpose());
  base.has_covariance = camera.has_covariance;
  Eigen::Matrix<double, 6, 1> twist;
  twist << camera.motion.velocity, camera.motion.turn_rate;
  twist = adjoint * twist;
  base.motion = {twist.head<3>(), twist.tail<3>()};
  base.has_motion = camera.has_motion;
  return base;
}

Rigid3 ForwardLeftUpFromCamera() {
  Eigen::Matrix3d rotation;
  rotation << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  return Rigid3::FromMatrix(rotation, Eigen::Vector3d::Zero());
}

}  // namespace tessera
