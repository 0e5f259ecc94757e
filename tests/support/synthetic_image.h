// Textured images for tests that need features but no data set.
#pragma once

#include <algorithm>
#include <random>

#include "core/image.h"

namespace tessera {

// Random bright and dark rectangles on a mid-grey ground, repeatable by seed.
inline GrayImage RectanglesImage(int width, int height, unsigned seed) {
  GrayImage image(width, height, 100);
  std::mt19937 generator(seed);
  const auto below = [&](int bound) { return static_cast<int>(generator() % static_cast<unsigned>(bound)); };
  for (int i = 0; i < width * height / 400; ++i) {
    const int x0 = below(width), y0 = below(height);
    const int x1 = std::min(width, x0 + 4 + below(24)), y1 = std::min(height, y0 + 4 + below(24));
    const auto intensity = static_cast<uint8_t>(below(256));
    for (int y = y0; y < y1; ++y) std::fill(image.row(y) + x0, image.row(y) + x1, intensity);
  }
  return image;
}

}  // namespace tessera
