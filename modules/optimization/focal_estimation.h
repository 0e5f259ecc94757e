// The focal length under which keyframes and landmarks agree best.
#pragma once

#include <optional>

#include "optimization/bundle_adjustment.h"

namespace tessera {

struct FocalEstimate {
  double error = 0.0;  // the best focal lengths are 1 + error times those given, fx and fy alike
  double sigma = 0.0;  // its standard deviation
};

// With C(e) the least robust cost of the problem (AdjustBundle) when its focal lengths are 1 + e times those given,
// the parabola through C(-h), C(0), C(h), h = 1 %:
//
//   error = -C' / C'',   sigma = 1 / sqrt(C'')            C: half a sum of squares of standard deviation 1
//
// A camera that only goes straight shows the same images with another focal length and another depth: C'' is small
// then. One that turns does not. nullopt: the problem can't be solved, or shows nothing of the focal length.
std::optional<FocalEstimate> EstimateFocal(const BundleProblem& problem);

// The problem's focal lengths, 1 + error times as long.
FocalLengths ScaledFocal(const CameraCalibration& calibration, double error);

}  // namespace tessera
