// Small images, doubled before anything else sees them.
//
// A corner is found to a third of a pixel, whatever its pixel is worth; and all that decides by pixels, how far around
// its prediction a point is looked for, how wide a residual may be, lets in twice the angle where the focal length is
// half as long. What is let in are corners that crept along with the image; the scale of mono followed them by 5 % in
// 100 m. Such images, of cheap cameras, hold more than that: doubled, they are as good as larger ones
// (README of the tracker, "Small images"; SIFT doubles its images, too: D. Lowe, "Distinctive Image Features from
// Scale-Invariant Keypoints", IJCV 2004).
#pragma once

#include <memory>

#include "datasets/frame_source.h"

namespace tessera {

// The source itself, unless its focal length is below `min_focal_px`: then its frames and their calibration, doubled.
// A pixel x is sampled at (x + 1/2) / 2 - 1/2: intensities and colors between pixels by exact sixteenths, depth counts
// at the nearest pixel.
std::unique_ptr<FrameSource> DoubleIfSmall(std::unique_ptr<FrameSource> source, double min_focal_px);

}  // namespace tessera
