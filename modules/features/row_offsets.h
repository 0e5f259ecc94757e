// How well the rows of a rectified pair's images belong together, measured on the images alone.
#pragma once

#include <vector>

#include "core/image.h"

namespace tessera {

// A point that the left image shows at (x_px, y_px), the right one offset_px lower than in that row.
struct RowOffset {
  double x_px = 0.0;  // in the right image
  double y_px = 0.0;  // in the left image
  double offset_px = 0.0;
};

// Of at most one textured window per cell of 48 px. Each is searched in the rows from `above` to `below` beside its
// own, at disparities of 0 to 128 px, then placed between the pixels by Gauss-Newton steps on its intensities (B.
// Lucas, T. Kanade, "An Iterative Image Registration Technique with an Application to Stereo Vision", IJCAI 1981),
// whatever the brightness of the two images. Rows beside the image are not searched. Both images must have the same
// size.
std::vector<RowOffset> MeasureRowOffsets(const GrayImage& left, const GrayImage& right, int above, int below);

}  // namespace tessera
