// Colors out of decoded images.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/image.h"

namespace tessera {

// The image itself; empty if all its pixels are gray: that is how decoders of video give images without color.
ColorImage NoneIfGray(ColorImage image);

// Of an image of type CV_8UC3, blue first; empty if all its pixels are gray.
ColorImage ColorsOf(const cv::Mat& image);

}  // namespace tessera
