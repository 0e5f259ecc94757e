#include "geometry/rigid3.h"

#include <cmath>

namespace tessera {

Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& omega_rad) {
  const double angle_squared = omega_rad.squaredNorm();
  const double angle = std::sqrt(angle_squared);
  // sin(a/2)/a, with its Taylor series where the quotient would lose digits.
  const double half_sinc = angle < 1e-5 ? 0.5 - angle_squared / 48.0 : std::sin(0.5 * angle) / angle;
  const Eigen::Vector3d v = half_sinc * omega_rad;
  return Eigen::Quaterniond(std::cos(0.5 * angle), v.x(), v.y(), v.z()).normalized();
}

Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation) {
  // q and -q are the same rotation; the one with w >= 0 has the angle <= pi.
  const double sign = rotation.w() < 0.0 ? -1.0 : 1.0;
  const double w = sign * rotation.w();
  const Eigen::Vector3d v = sign * rotation.vec();
  const double sine = v.norm();
  if (sine < 1e-10) {
    return 2.0 / w * v;
  }
  return 2.0 * std::atan2(sine, w) / sine * v;
}

Rigid3 Retract(const Rigid3& a_from_b, const Eigen::Matrix<double, 6, 1>& delta) {
  return Rigid3{ExpSO3(delta.tail<3>()), delta.head<3>()} * a_from_b;
}

Sim3 Retract(const Sim3& a_from_b, const Eigen::Matrix<double, 7, 1>& delta) {
  return Sim3{std::exp(delta(6)), ExpSO3(delta.segment<3>(3)), delta.head<3>()} * a_from_b;
}

Eigen::Matrix<double, 7, 1> TangentOf(const Sim3& a_from_b) {
  Eigen::Matrix<double, 7, 1> tangent;
  tangent << a_from_b.translation, LogSO3(a_from_b.rotation), std::log(a_from_b.scale);
  return tangent;
}

Rigid3 Interpolate(const Rigid3& from, const Rigid3& to, double fraction) {
  return {from.rotation.slerp(fraction, to.rotation).normalized(),
          (1.0 - fraction) * from.translation + fraction * to.translation};
}

}  // namespace tessera
