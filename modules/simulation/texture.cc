#include "simulation/texture.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

// Mean of each 2x2 block; an odd last row or column counts twice.
GrayImage Halve(const GrayImage& image) {
  GrayImage half(std::max(2, (image.width + 1) / 2), std::max(2, (image.height + 1) / 2));
  for (int y = 0; y < half.height; ++y) {
    const uint8_t* first = image.row(std::min(2 * y, image.height - 1));
    const uint8_t* second = image.row(std::min(2 * y + 1, image.height - 1));
    for (int x = 0; x < half.width; ++x) {
      const int left = std::min(2 * x, image.width - 1);
      const int right = std::min(2 * x + 1, image.width - 1);
      half.row(y)[x] = static_cast<uint8_t>((first[left] + first[right] + second[left] + second[right] + 2) / 4);
    }
  }
  return half;
}

std::vector<GrayImage> MakeLevels(GrayImage finest) {
  std::vector<GrayImage> levels;
  levels.push_back(std::move(finest));
  while (levels.back().width > 2 || levels.back().height > 2) {
    levels.push_back(Halve(levels.back()));
  }
  return levels;
}

}  // namespace

Texture MakeTexture(GrayImage paint, GrayImage cover) {
  Texture texture;
  texture.levels = MakeLevels(std::move(paint));
  if (!cover.empty()) {
    texture.cover = MakeLevels(std::move(cover));
  }
  return texture;
}

}  // namespace tessera
