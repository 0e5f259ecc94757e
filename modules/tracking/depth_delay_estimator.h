// How much later than the image the depths are measured (measurement/depth_delay.h), by what the images show; or how
// much later than the source says.
//
// While the camera of a frame moves, the inverse depth that is measured at a keypoint changes by f per second
// (InverseDepthRate), and that of the same point in the reference keyframe by f_ref, when its depth was measured there.
// If the delay that was taken out is too short by d, the frame's depths are wrong by d f, and the map's points lie,
// where the reference's depths placed them, too near by a share d f_ref / w_ref:
//
//   r = J p + d g,    g = (0, 0, fx b f) - by_point (f_ref / w_ref) point
//
// as in time_offset.h, with the disparity fx b w of an inverse depth w. A camera that moves as it did at its reference
// says nothing: the map is wrong alike then.
#pragma once

#include "matching/point_matching.h"
#include "tracking/readout_estimator.h"
#include "tracking/time_offset.h"

namespace tessera {

class DepthDelayEstimator {
 public:
  // `frame` was tracked with depths moved by delay_s(), and outliers are removed; its camera moved by `motion`.
  void Add(const TrackedFrame& frame, const CameraMotion& motion, const MovingView& reference);
  // > 0: depths are measured after the image is taken. 0 until it is known that it isn't.
  double delay_s() const;

 private:
  TimeOffset delay_;
};

}  // namespace tessera
