// Smoothing of a pyramid level by cascaded averages.
#pragma once

#include <cstdint>
#include <vector>

#include "features/pyramid.h"

namespace tessera {

class Smoother {
 public:
  // Taps a, b, a of three pixels that are `step` apart, (1 2 1) / 4, first along y, then along x, each computed as
  // average(average(left, right), middle) with averages of two rounded up. Steps 1 and 2 one after the other have the
  // taps (1 2 3 4 3 2 1) / 16, sigma 1.6 px.
  //
  // Makes `out` the part `region` of the level; `image` must hold `step` pixels around it.
  void Smooth(const LevelImage& image, const Rect& region, int step, LevelImage& out);

 private:
  std::vector<uint8_t> row_;  // one row, smoothed along y
};

}  // namespace tessera
