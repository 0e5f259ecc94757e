// PNG files of the usual kinds, decoded in 0.6 to 0.9 of the time that libpng needs: LodePNG, with libdeflate in zlib's
// place.
#pragma once

#include <optional>
#include <string>

#include "core/image.h"

namespace tessera {

// Each takes the bytes of a whole file, and gives what OpenCV reads of it, bit for bit. None: the file is of another
// kind (interlaced, with a palette, with transparency, with a gamma to be respected, of another depth) or damaged.

// Of 8 bits, gray or color.
std::optional<GrayImage> GrayOfPng(const std::string& bytes);

// Of 8 bits and in color; empty if all pixels are gray.
std::optional<ColorImage> ColorOfPng(const std::string& bytes);

// Of 16 bits, one channel.
std::optional<DepthImage> DepthOfPng(const std::string& bytes);

}  // namespace tessera
