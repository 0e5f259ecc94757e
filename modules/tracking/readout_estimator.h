// How long the camera takes to read an image (rolling shutter), by what the images show.
//
// A frame and its reference keyframe moved differently while they were read, so their rows are shifted differently. If
// the readout by which keypoints were moved (Unroll) is too short by d, the residuals r of a frame's points are
//
//   r = J p + d g,    g = by_point (RowTime PointVelocity of the frame - the same of the reference, turned into it)
//
// as in time_offset.h. Where the reference was distorted alike, g is small and says little. Where the map has bent to
// fit distorted views, d comes out too small; but it has the sign of the error and vanishes with it, and so the
// estimate, once corrected, comes to the true one.
#pragma once

#include "matching/point_matching.h"
#include "measurement/rolling_shutter.h"
#include "tracking/time_offset.h"

namespace tessera {

// A camera that moved while its image was read.
struct MovingView {
  Rigid3 world_from_camera;
  CameraMotion motion;
};

class ReadoutEstimator {
 public:
  // `frame` was tracked with keypoints moved by readout_s(), and outliers are removed; its camera moved by `motion`.
  void Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference);
  // From the first row to the last, s. 0 until it is known that it isn't.
  double readout_s() const;

 private:
  TimeOffset readout_;
};

}  // namespace tessera
