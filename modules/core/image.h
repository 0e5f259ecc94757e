// Images as plain values: row-major pixels without padding, and views into them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// Axis-aligned rectangle of pixels [x, x + width) x [y, y + height).
struct Rect {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;

  int right() const { return x + width; }
  int bottom() const { return y + height; }
  bool empty() const { return width <= 0 || height <= 0; }
  bool operator==(const Rect&) const = default;
};

// Image of height x width pixels, stored row after row.
template <class Pixel>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<Pixel> pixels;

  Image() = default;
  Image(int width_px, int height_px, Pixel fill = {})
      : width(width_px),
        height(height_px),
        pixels(static_cast<size_t>(width_px) * static_cast<size_t>(height_px), fill) {}

  bool empty() const { return pixels.empty(); }
  Pixel* row(int y) { return pixels.data() + static_cast<ptrdiff_t>(y) * width; }
  const Pixel* row(int y) const { return pixels.data() + static_cast<ptrdiff_t>(y) * width; }
  bool operator==(const Image&) const = default;
};

struct Rgb {
  uint8_t red = 0;  // sRGB, 0..255
  uint8_t green = 0;
  uint8_t blue = 0;

  bool operator==(const Rgb&) const = default;
};

using GrayImage = Image<uint8_t>;  // intensity 0..255
using ColorImage = Image<Rgb>;
using DepthImage = Image<uint16_t>;  // counts of `CameraCalibration::depth_unit_m`; 0: unknown

// The pixels of `rect`, which must lie inside the image.
template <class Pixel>
Image<Pixel> Crop(const Image<Pixel>& image, const Rect& rect) {
  Image<Pixel> crop;
  crop.width = rect.width;
  crop.height = rect.height;
  crop.pixels.reserve(static_cast<size_t>(rect.width) * static_cast<size_t>(rect.height));
  for (int y = rect.y; y < rect.bottom(); ++y) {
    const Pixel* begin = image.row(y) + rect.x;
    crop.pixels.insert(crop.pixels.end(), begin, begin + rect.width);
  }
  return crop;
}

}  // namespace tessera
