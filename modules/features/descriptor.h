// Orientation and descriptor of a keypoint, after ORB (Rublee et al. 2011), in integers only.
#pragma once

#include <cstdint>
#include <vector>

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

// Smooths along both axes with the taps (1 2 3 4 3 2 1) / 16, as (1 2 1) / 4 and then (1 0 2 0 1) / 4; each of the
// averages of two that make them is rounded up to a whole number.
class Smoother {
 public:
  // Makes `out` the part `region` of the smoothed level; `image` must hold kBlurRadiusPx around it.
  void Smooth(const LevelImage& image, const Rect& region, LevelImage& out);

 private:
  uint8_t* NearRow(int y) { return near_rows_[static_cast<size_t>(y % 5)].data(); }
  void SmoothNear(const LevelImage& image, const Rect& region, int y);

  std::vector<uint8_t> near_rows_[5];  // rows smoothed vertically by the near taps
  std::vector<uint8_t> row_;           // one row, smoothed vertically by all taps
};

// 256 tests I(p) < I(q) on the smoothed image, at the point pairs of the pattern turned by the angle (rounded to 1/64
// turn, positions rounded to pixels). The image must hold kPatchRadiusPx around (x, y).
Descriptor Describe(const LevelImage& smoothed, int x, int y, uint8_t angle);

}  // namespace tessera
