// How long the camera takes to read an image (rolling shutter), by what the images show.
//
// A frame and its reference keyframe moved differently while they were read, so their rows are shifted differently. If
// the readout by which keypoints were moved (Unroll) is too short by d, the residuals r of a frame's points are
//
//   r = J p + d g,    g = by_point (RowTime PointVelocity of the frame - the same of the reference, turned into it)
//
// and likewise for columns; d is found as in time_offset.h. Where the reference was distorted alike, g is small and
// says little. Where the map has bent to fit distorted views, d comes out too small; but it has the sign of the error
// and vanishes with it, and so the estimate, once corrected, comes to the true one.
//
// Whether rows or columns are read, and from which end, nobody tells. Rows from the top are usual. Everything else must
// explain much of the residuals (TimeOffset::ExplainedShare): it is 4 to 15 % where it is so, and up to 2 % where it
// isn't, as a camera that turns about the vertical stretches images a little in a map that isn't exact. In mono, rows
// from the top must explain 2 %, or half a percent after 80 frames: over a plane that it looks down at, the map bends
// with the way, which explains up to 1.5 % in the first second and 0.35 % later; where rows are read, it is 1 to 20 %.
// What is found stays.
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
  // `frame` was tracked with keypoints moved by readout(), and outliers are removed; its camera moved by `motion`.
  void Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference);
  // Of rows, or of columns. 0 until it is known that it isn't.
  Readout readout() const;

 private:
  enum class Order { kUnknown, kDown, kUp, kAcross };
  Order FindOrder() const;

  TimeOffset down_, across_;
  Order order_ = Order::kUnknown;
  bool rolls_ = false;  // as is usual: row after row from the top, unless order_ says otherwise
};

}  // namespace tessera
