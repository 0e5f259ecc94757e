// What the images of a stereo pair say of how its two cameras stand to each other: a right camera that squints by a
// tenth of a degree shows everything a pixel aside, and all that is far too near or too far.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "optimization/bundle_adjustment.h"

namespace tessera {

// Of a RightShift's four numbers, in their order, px: information * shift = right_side.
struct RightShiftEquations {
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right_side = Eigen::Vector4d::Zero();
};

// How far the camera has gone from image to image, and at how many places a point was seen, tells how far away it is;
// so does the right image. With C(s) the least robust cost of the problem when its right columns are moved further by
// s, the best s is the minimum of C, about a parabola:
//
//   C'' s = -C'     C'(s) = sum_i w_i e_i de_i/ds at the least cost's poses and points, whose change adds nothing at a
//                           minimum (envelope theorem)
//                   C'' by differences of C' over 1/4 px
//
// Estimates of one camera differ by twice what their curvature says (as in LensEstimator): both sides are divided by 4.
// nullopt: the problem can't be solved.
std::optional<RightShiftEquations> EquationsOfRightShift(const BundleProblem& problem);

// The problem with right columns moved further by `shift`.
BundleProblem WithRightShift(BundleProblem problem, const RightShift& shift);

}  // namespace tessera
