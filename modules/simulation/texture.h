// Painted surfaces: gray values over a rectangle, with coarser and coarser copies for what is far away.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image.h"

namespace tessera {

// Level l + 1 has half the width and height of level l (2x2 means). Every level is at least 2x2.
struct Texture {
  std::vector<GrayImage> levels;
  // By level: 255 where something is, 0 where one looks through (leaves). Empty if there are no holes.
  std::vector<GrayImage> cover;
};

// Makes the coarser levels of a painted surface. `cover` may be empty.
Texture MakeTexture(GrayImage paint, GrayImage cover);

}  // namespace tessera
