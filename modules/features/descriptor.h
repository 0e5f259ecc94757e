// Orientation and descriptor of a keypoint, after ORB (Rublee et al. 2011), in integers only.
#pragma once

#include <cstdint>

#include "features/feature_types.h"
#include "features/pyramid.h"

namespace tessera {

// The direction from the keypoint to the intensity centroid of the disc of radius 15 px around it,
//
//   angle = atan2(sum y I(x, y), sum x I(x, y)),
//
// in 1/256 turn, rounded to nearest. The image must hold kPatchRadiusPx around (x, y).
uint8_t Orientation(const LevelImage& image, int x, int y);

// atan2(y, x) in 1/256 turn, rounded to nearest; 0 for (0, 0). Both within +-2^40.
uint8_t AngleOf(int64_t x, int64_t y);

// 256 tests I(p) < I(q) on the doubly smoothed image (smoother.h), at the point pairs of the pattern turned by the
// angle (rounded to 1/64 turn, positions rounded to pixels). The image must hold kPatchRadiusPx around (x, y).
Descriptor Describe(const LevelImage& smoothed, int x, int y, uint8_t angle);

}  // namespace tessera
