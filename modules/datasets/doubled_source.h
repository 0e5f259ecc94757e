// Small images, doubled before anything else sees them.
//
// Search radii and residuals have limits in pixels. Where the focal length is half as long, these let in twice the
// angle, and with it corners that creep along with the image: the scale of mono fell by 5 % in 100 m. Yet the images of
// such cameras show more than that: doubled, they do as well as larger ones (stages/tracker/MEASUREMENTS.md, "Small
// images"). SIFT doubles its images, too (D. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV
// 2004).
#pragma once

#include <memory>

#include "datasets/frame_source.h"

namespace tessera {

// The source itself, unless its focal length is below `min_focal_px`: then its frames and their calibration, doubled.
// Intensities and colors are interpolated, depth counts are not (remap_table.h). Throws InputError if the images are
// less than two pixels wide or high.
std::unique_ptr<FrameSource> DoubleIfSmall(std::unique_ptr<FrameSource> source, double min_focal_px);

}  // namespace tessera
