// Colors out of OpenCV's images.
#pragma once

#include <opencv2/core/mat.hpp>

#include "core/image.h"

namespace tessera {

// Of an image of type CV_8UC3, blue first; empty if all its pixels are gray: that is how decoders of video give images
// without color.
ColorImage ColorsOf(const cv::Mat& image);

}  // namespace tessera
