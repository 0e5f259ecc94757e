// How exactly the position of a keypoint is known: the one noise model, that all estimators derive theirs from.
#pragma once

#include "geometry/camera.h"

namespace tessera {

// Standard deviation of each coordinate, in pixels of the keypoint's pyramid level (measurement/keypoint_measurement.h
// scales it): what residuals of bundle adjustment show (0.25 to 0.55), and some of the map's error. A wider one lets in
// corners that only look alike; they make motion come out too small, and with a mono camera the scale, which nothing
// else holds. Where depth is measured, a wider one finds more points again where much changes from image to image.
constexpr double KeypointSigmaPx(SensorType sensor) { return sensor == SensorType::kMono ? 0.45 : 0.7; }

// The same in pixels of the image, for estimators that do not know the levels of their keypoints (two views): about the
// mean over the levels where most keypoints are.
inline constexpr double kMixedLevelSigmaPx = 1.0;

}  // namespace tessera
