// How long the camera takes to read an image (rolling shutter), by what the images show.
//
// A frame and its reference keyframe moved differently while they were read, so their rows are shifted differently. If
// the readout by which keypoints were moved (Unroll) is too short by d, the residuals r of a frame's points are
//
//   r = J p + d g,    g = by_point (RowTime PointVelocity of the frame - the same of the reference, turned into it)
//
// and noise, with J p from the error of its pose. Eliminating p gives d and its variance. Where the reference was
// distorted alike, g is small and says little. Where the map has bent to fit distorted views, d comes out too small;
// but it has the sign of the error and vanishes with it, and so the estimate, once corrected, comes to the true one.
#pragma once

#include <optional>

#include "matching/point_matching.h"
#include "measurement/rolling_shutter.h"

namespace tessera {

class ReadoutEstimator {
 public:
  // A camera that moved while its image was read.
  struct MovingView {
    Rigid3 world_from_camera;
    CameraMotion motion;
  };

  // `frame` was tracked with keypoints moved by readout_s(), and outliers are removed; its camera moved by `motion`.
  void Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference);
  // From the first row to the last, s. 0 until it is known that it isn't, to four standard deviations.
  double readout_s() const;

 private:
  double estimate_s_ = 0.0;
  double variance_ = kInitialSigma_s * kInitialSigma_s;

  static constexpr double kInitialSigma_s = 0.01;
};

}  // namespace tessera
