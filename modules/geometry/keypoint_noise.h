// How exactly the position of a keypoint is known: the one noise model, that all estimators derive theirs from.
#pragma once

namespace tessera {

// Standard deviation of each coordinate, in pixels of the keypoint's pyramid level (measurement/keypoint_measurement.h
// scales it): what residuals of bundle adjustment show (0.55), and some of the map's error. A wider one lets in corners
// that only look alike; they make motion come out too small.
inline constexpr double kKeypointSigmaPx = 0.7;

// The same in pixels of the image, for estimators that do not know the levels of their keypoints (two views): about the
// mean over the levels where most keypoints are.
inline constexpr double kMixedLevelSigmaPx = 1.0;

}  // namespace tessera
