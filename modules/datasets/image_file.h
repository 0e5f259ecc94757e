// Image files of data sets, in any format that OpenCV reads, checked for completeness: OpenCV itself fills
// the missing part of a truncated JPEG or PNG with gray without an error.
#pragma once

#include <string>
#include <vector>

#include "core/image.h"

namespace tessera {

// The intensities of an image file; color is converted by the decoder's integer arithmetic.
// Throws InputError if the file is missing, truncated or not an image.
GrayImage ReadGrayImage(const std::string& path);

// The colors of an image file; empty if it is gray. Throws InputError as above.
ColorImage ReadColorImage(const std::string& path);

// The counts of a depth image file: one channel of 16 bits. Throws InputError as above.
DepthImage ReadDepthImage(const std::string& path);

// The image files in a folder (by extension) in order of their names; none if it does not exist.
std::vector<std::string> ListImages(const std::string& folder);

// `path`, or the file of the same name with another image extension, whichever exists; empty if none does.
std::string FindImage(const std::string& path);

// Throws InputError with what is wrong and where if the image isn't of this size.
void RequireSize(int width_px, int height_px, int expected_width_px, int expected_height_px, const std::string& what);

}  // namespace tessera
