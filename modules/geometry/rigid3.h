// Rigid and similarity transforms of space, named so that frames cancel:
//
//   point_in_world = world_from_camera * point_in_camera
//   world_from_camera = world_from_body * body_from_camera
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tessera {

// a_from_b: x_a = rotation * x_b + translation. The rotation is a unit quaternion; translation in meters
// (mono: in units of the map).
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  static Rigid3 Identity() { return {}; }
  // From a 3x3 rotation matrix (orthonormal up to rounding) and a translation.
  static Rigid3 FromMatrix(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) {
    return {Eigen::Quaterniond(rotation).normalized(), translation};
  }

  Rigid3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
  Eigen::Matrix<double, 3, 4> Matrix() const {
    Eigen::Matrix<double, 3, 4> m;
    m << rotation.toRotationMatrix(), translation;
    return m;
  }
};

inline Rigid3 operator*(const Rigid3& a_from_b, const Rigid3& b_from_c) {
  return {(a_from_b.rotation * b_from_c.rotation).normalized(),
          a_from_b.rotation * b_from_c.translation + a_from_b.translation};
}
inline Eigen::Vector3d operator*(const Rigid3& a_from_b, const Eigen::Vector3d& point_in_b) {
  return a_from_b.rotation * point_in_b + a_from_b.translation;
}

// a_from_b with scale: x_a = scale * (rotation * x_b) + translation; scale > 0.
struct Sim3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  static Sim3 From(const Rigid3& a_from_b, double scale = 1.0) {
    return {scale, a_from_b.rotation, a_from_b.translation};
  }
  // Where frame b stands and how it is turned, without its scale.
  Rigid3 Pose() const { return {rotation, translation}; }
  Sim3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {1.0 / scale, inverse, -(inverse * translation) / scale};
  }
};

inline Sim3 operator*(const Sim3& a_from_b, const Sim3& b_from_c) {
  return {a_from_b.scale * b_from_c.scale, (a_from_b.rotation * b_from_c.rotation).normalized(),
          a_from_b.scale * (a_from_b.rotation * b_from_c.translation) + a_from_b.translation};
}
inline Sim3 operator*(const Sim3& a_from_b, const Rigid3& b_from_c) { return a_from_b * Sim3::From(b_from_c); }
inline Eigen::Vector3d operator*(const Sim3& a_from_b, const Eigen::Vector3d& point_in_b) {
  return a_from_b.scale * (a_from_b.rotation * point_in_b) + a_from_b.translation;
}

// The rotation by |omega| radians about omega (exponential map of SO(3)); exact to rounding also near zero.
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& omega_rad);
// Its inverse, with |result| <= pi.
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation);
// About the same axis by half the angle: of a steady turn, from its beginning to its middle.
inline Eigen::Quaterniond HalfOf(const Eigen::Quaterniond& turn) { return ExpSO3(0.5 * LogSO3(turn)); }

// Tangent vectors of SE(3) are (translation [m], rotation [rad]) stacked, applied from the left:
//   Retract(a_from_b, delta) = Rigid3{ExpSO3(delta.tail<3>()), delta.head<3>()} * a_from_b
// (first-order equal to the exponential map, cheaper, and as good for optimization).
Rigid3 Retract(const Rigid3& a_from_b, const Eigen::Matrix<double, 6, 1>& delta);

// Of Sim(3): (translation, rotation [rad], logarithm of scale) stacked, applied from the left:
//   Retract(a_from_b, delta) = Sim3{exp(delta(6)), ExpSO3(delta.segment<3>(3)), delta.head<3>()} * a_from_b
// delta(6) = 0 keeps the scale to the bit.
Sim3 Retract(const Sim3& a_from_b, const Eigen::Matrix<double, 7, 1>& delta);
// The tangent with Retract(Sim3{}, tangent) = a_from_b.
Eigen::Matrix<double, 7, 1> TangentOf(const Sim3& a_from_b);

// Pose a fraction of the way from `from` (0) to `to` (1): linear in translation, slerp in rotation.
Rigid3 Interpolate(const Rigid3& from, const Rigid3& to, double fraction);

}  // namespace tessera
