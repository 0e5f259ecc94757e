#include "wire/image_bands.h"

#include <algorithm>
#include <cstring>

#include "wire/field_conversions.h"

namespace tessera {
namespace {

// Pixels for which memory is taken before they have come: a false size must not cost memory.
constexpr size_t kMaxReservedPixels = size_t{1} << 23;

constexpr int8_t EncodingOf(const GrayImage&) { return image_band_t::GRAY8; }
constexpr int8_t EncodingOf(const DepthImage&) { return image_band_t::DEPTH16; }
constexpr int8_t EncodingOf(const ColorImage&) { return image_band_t::RGB8; }
static_assert(sizeof(Rgb) == 3);

Rect NextBand(int x, int y, int width, int height, int max_pixels) {
  const int rows = max_pixels / width;
  if (x == 0 && rows >= 1) return {0, y, width, std::min(rows, height - y)};
  return {x, y, std::min(max_pixels, width - x), 1};
}

template <class Pixel>
size_t Fill(int8_t name, const Image<Pixel>& image, size_t first, size_t max_bytes, image_band_t* band) {
  const auto row = static_cast<size_t>(image.width);
  const auto max_pixels = static_cast<int>(std::max<size_t>(1, max_bytes / sizeof(Pixel)));
  const Rect pixels =
      NextBand(static_cast<int>(first % row), static_cast<int>(first / row), image.width, image.height, max_pixels);
  const size_t num_pixels = static_cast<size_t>(pixels.width) * static_cast<size_t>(pixels.height);
  const auto* const bytes = reinterpret_cast<const uint8_t*>(image.pixels.data() + first);
  band->image = name;
  band->encoding = EncodingOf(image);
  WriteField(pixels, band->pixels);
  band->num_bytes = static_cast<int32_t>(num_pixels * sizeof(Pixel));
  band->data.assign(bytes, bytes + num_pixels * sizeof(Pixel));
  return num_pixels;
}

template <class Pixel>
Result<> Append(const image_band_t& band, int width, int height, Image<Pixel>* image) {
  constexpr const char* kMisplaced = "its band of pixels does not follow the one before it or leaves the image";
  Rect at;
  TESSERA_RETURN_IF_FAILED(ReadField(band.pixels, at));
  TESSERA_RETURN_IF_FAILED(Require(IsInside(at, width, height), kMisplaced));
  const auto row = static_cast<size_t>(width);
  const size_t num_had = image->pixels.size();
  const bool follows = static_cast<size_t>(at.y) * row + static_cast<size_t>(at.x) == num_had;
  TESSERA_RETURN_IF_FAILED(Require(follows && (at.width == width || at.height == 1), kMisplaced));
  const size_t num_pixels = static_cast<size_t>(at.width) * static_cast<size_t>(at.height);
  if (band.encoding != EncodingOf(*image) || static_cast<size_t>(band.num_bytes) != num_pixels * sizeof(Pixel)) {
    return Failed("its band has another number of bytes than its rectangle of pixels needs");
  }
  if (num_had == 0) {
    image->width = width;
    image->height = height;
    image->pixels.reserve(std::min(row * static_cast<size_t>(height), kMaxReservedPixels));
  }
  if constexpr (sizeof(Pixel) == 1) {
    image->pixels.insert(image->pixels.end(), band.data.begin(), band.data.end());
  } else {
    image->pixels.resize(num_had + num_pixels);
    std::memcpy(image->pixels.data() + num_had, band.data.data(), band.data.size());
  }
  return {};
}

}  // namespace

size_t FillBand(int8_t name, const GrayImage& image, size_t first, size_t max_bytes, image_band_t* band) {
  return Fill(name, image, first, max_bytes, band);
}
size_t FillBand(int8_t name, const DepthImage& image, size_t first, size_t max_bytes, image_band_t* band) {
  return Fill(name, image, first, max_bytes, band);
}
size_t FillBand(int8_t name, const ColorImage& image, size_t first, size_t max_bytes, image_band_t* band) {
  return Fill(name, image, first, max_bytes, band);
}

Result<> AppendBand(const image_band_t& band, int width, int height, GrayImage* image) {
  return Append(band, width, height, image);
}
Result<> AppendBand(const image_band_t& band, int width, int height, DepthImage* image) {
  return Append(band, width, height, image);
}
Result<> AppendBand(const image_band_t& band, int width, int height, ColorImage* image) {
  return Append(band, width, height, image);
}

}  // namespace tessera
