// Where the body that carries the camera is, how sure that is, and how it moves: what a controller or a filter needs.
//
// The body's frame is called base. The world that its poses are given in is the base where the camera was at the origin
// of the map:  world_from_base = base_from_camera * (map's world_from_camera) * base_from_camera^-1.
// Lengths in m (mono: units of the map).
#pragma once

#include <Eigen/Core>

#include "geometry/rigid3.h"

namespace tessera {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct BodyMotion {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // per s, in the base's axes
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // rad/s, about the base's axes
};

struct BodyState {
  Rigid3 world_from_base;
  // Of delta = (translation, rotation [rad]) in the base's axes, with true world_from_base = world_from_base *
  // Exp(delta). Against the reference keyframe of the frame (for a keyframe: the one before it): what the map has
  // drifted until there is not in it, nor, in mono, the error of the scale.
  Matrix6d covariance = Matrix6d::Zero();
  BodyMotion motion = {};
  bool has_covariance = false;
  bool has_motion = false;
};

// Ad: with A = `transform`,  A Exp(delta) A^-1 = Exp(Ad delta)  for delta = (translation, rotation).
//
//   Ad = [R, [t]x R; 0, R]
Matrix6d AdjointOf(const Rigid3& transform);

// Of a camera taken as a body of its own, what it says of the base that carries it:
//
//   Ad: of base_from_camera,  covariance = Ad covariance_camera Ad',   (velocity, turn_rate) = Ad (velocity,
//   turn_rate)_camera
BodyState StateOfBase(const BodyState& camera, const Rigid3& base_from_camera);
// The pose alone.
Rigid3 PoseOfBase(const Rigid3& world_from_camera, const Rigid3& base_from_camera);

// A base with the axes of REP 103 (x forward, y left, z up) in the place of the camera (x right, y down, z forward).
Rigid3 ForwardLeftUpFromCamera();

}  // namespace tessera
