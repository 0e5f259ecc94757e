// How exactly the position of a keypoint is known: the one noise model, that all estimators derive theirs from.
#pragma once

#include "geometry/camera.h"

namespace tessera {

// Standard deviation of each coordinate, in pixels of the keypoint's pyramid level (measurement/keypoint_measurement.h
// scales it): what residuals of bundle adjustment show (0.25 to 0.55), and some of the map's error. A wider one lets in
// corners that only look alike; they make motion come out too small, and with a mono camera the scale, which nothing
// else holds. Depth cameras blur, and their lines are not exposed at one time.
constexpr double KeypointSigmaPx(SensorType sensor) { return sensor == SensorType::kRgbd ? 0.7 : 0.45; }

// And a corner that is seen from another side than before is found beside its point: by so much more in each radian
// between the line of sight and the mean of its earlier ones. Measured in stereo: 0.45 px from within 5 degrees, 0.65
// from 25. Nothing in mono, where any wider noise costs scale; RGB-D's above is wide enough.
constexpr double AsideSigmaPxPerRad(SensorType sensor) { return sensor == SensorType::kStereo ? 1.0 : 0.0; }

// The same in pixels of the image, for estimators that do not know the levels of their keypoints (two views): about the
// mean over the levels where most keypoints are.
inline constexpr double kMixedLevelSigmaPx = 1.0;

}  // namespace tessera
