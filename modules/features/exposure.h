// Cameras of a stereo pair that set their exposure each by itself.
#pragma once

#include "core/image.h"

namespace tessera {

// Brings the right image to the left one's contrast and brightness, where the contrasts differ so much that windows of
// the two can't be compared (StereoMatcher allows for another brightness by itself):
//
//   right' = mean(left) + gain (right - mean(right)),   gain = spread(left) / spread(right)
//
// with mean and spread over the quantiles 0.05, 0.10 ... 0.95 of an image's brightness, without those that are clipped
// to black or white in either. The two cameras see the same scene but for the edges.
void MatchExposure(const GrayImage& left, GrayImage& right);

}  // namespace tessera
