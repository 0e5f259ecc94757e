// How exactly the position of a keypoint is known: the one noise model, that all estimators derive theirs from.
#pragma once

#include "geometry/camera.h"

namespace tessera {

// Standard deviation of each coordinate, in pixels of the keypoint's pyramid level (measurement/keypoint_measurement.h
// scales it). Residuals of bundle adjustment show 0.25 to 0.4. A wider one lets in corners that only look alike, or
// creep along with the growing image; with a narrower one, mono drifts in KITTI 03. A pair holds the scale by itself:
// there the narrow one is right (stages/tracker/MEASUREMENTS.md, "How exact a keypoint is").
constexpr double KeypointSigmaPx(SensorType sensor) { return sensor == SensorType::kStereo ? 0.45 : 0.7; }

// The same in pixels of the image, for estimators that do not know the levels of their keypoints (two views): about the
// mean over the levels where most keypoints are.
inline constexpr double kMixedLevelSigmaPx = 1.0;

}  // namespace tessera
