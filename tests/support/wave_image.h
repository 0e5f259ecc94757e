// Images of smooth bumps without a period, whose value between pixels is known.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/image.h"

namespace tessera {

// What stands at (x, y) of the image that isn't moved stands at (x - left_px, y + down_px) of this one.
inline GrayImage WaveImage(int width, int height, double left_px = 0.0, double down_px = 0.0, double brightness = 1.0) {
  GrayImage image(width, height);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const double x = column + left_px, y = row - down_px;
      const double waves = std::sin(0.31 * x + 0.11 * y) + std::sin(0.17 * x - 0.27 * y + 1.0) +
                           std::sin(0.05 * x + 0.37 * y + 2.0) + std::sin(0.0021 * x * y);
      image.row(row)[column] = static_cast<uint8_t>(std::lround(brightness * (110.0 + 22.0 * waves)));
    }
  }
  return image;
}

}  // namespace tessera
