// Images in bands: as many of the next pixels as fit into a message, whole rows, or a piece of a row where a row does
// not fit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/image.h"
#include "core/result.h"
#include "tessera/image_band_t.hpp"

namespace tessera {

// Fills the band with the pixels of `image` from number `first` on, with at most `max_bytes` of them, but one at least.
// Returns how many.
size_t FillBand(int8_t name, const GrayImage& image, size_t first, size_t max_bytes, image_band_t* band);
size_t FillBand(int8_t name, const DepthImage& image, size_t first, size_t max_bytes, image_band_t* band);
size_t FillBand(int8_t name, const ColorImage& image, size_t first, size_t max_bytes, image_band_t* band);

// Appends a band to an image of the given size, of which the pixels before the band must have come already.
Result<> AppendBand(const image_band_t& band, int width, int height, GrayImage* image);
Result<> AppendBand(const image_band_t& band, int width, int height, DepthImage* image);
Result<> AppendBand(const image_band_t& band, int width, int height, ColorImage* image);

}  // namespace tessera
