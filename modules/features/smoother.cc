#include "features/smoother.h"

#include <algorithm>

#include "features/simd.h"

namespace tessera {
namespace {

// 32 pixels of the row `in`, each smoothed with those `distance` bytes before and after.
inline void SmoothPixels(const uint8_t* in, ptrdiff_t distance, uint8_t* out) {
  const simd::U8x32 outer = simd::Average(simd::Load8(in - distance), simd::Load8(in + distance));
  simd::Store(out, simd::Average(outer, simd::Load8(in)));
}

}  // namespace

void Smoother::Smooth(const LevelImage& image, const Rect& region, int step, LevelImage& out) {
  out.Reset(region);
  row_.resize(std::max(row_.size(), static_cast<size_t>(region.width + 2 * step) + 64));
  const ptrdiff_t distance_y = static_cast<ptrdiff_t>(image.stride()) * step;
  for (int y = region.y; y < region.bottom(); ++y) {
    const uint8_t* in = image.At(region.x - step, y);
    for (int x = 0; x < region.width + 2 * step; x += 32) SmoothPixels(in + x, distance_y, row_.data() + x);
    uint8_t* out_row = out.At(region.x, y);
    for (int x = 0; x < region.width; x += 32) SmoothPixels(row_.data() + step + x, step, out_row + x);
  }
}

}  // namespace tessera
