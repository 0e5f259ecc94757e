// The similarity that lays one set of points on another.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "geometry/rigid3.h"

namespace tessera {

struct Alignment {
  Sim3 b_from_a;
  double rms = 0.0;  // of |b_from_a * a_i - b_i|, in units of b
};

// Minimizes sum |b_from_a * a_i - b_i|^2 over rotation, translation and, if `with_scale`, scale (else it is 1), in
// closed form: S. Umeyama, "Least-Squares Estimation of Transformation Parameters Between Two Point Patterns", PAMI
// 1991. The spans must have the same length. nullopt with fewer than three points, or if they all coincide in
// `a`; points on one line leave the rotation about it open, and some best one is returned.
std::optional<Alignment> AlignPoints(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                                     bool with_scale);

}  // namespace tessera
