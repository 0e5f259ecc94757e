// Colors that are added up, and can be taken out again.
#pragma once

#include <cstdint>

#include "core/image.h"

namespace tessera {

struct ColorSum {
  uint32_t red = 0;
  uint32_t green = 0;
  uint32_t blue = 0;

  // `sign`: 1, or -1 to take it out.
  void Add(const Rgb& color, int sign = 1) {
    red += static_cast<uint32_t>(sign * color.red);
    green += static_cast<uint32_t>(sign * color.green);
    blue += static_cast<uint32_t>(sign * color.blue);
  }
  // Of `num` colors, at least one.
  Rgb Mean(uint32_t num) const {
    return {static_cast<uint8_t>(red / num), static_cast<uint8_t>(green / num), static_cast<uint8_t>(blue / num)};
  }
};

}  // namespace tessera
