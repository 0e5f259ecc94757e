// Frame numbers and times of a live source that was reopened during a run: it counts from 0, the run continues.
#pragma once

#include <algorithm>
#include <cstdint>

#include "geometry/camera_frame.h"

namespace tessera {

class Renumbering {
 public:
  // `num_on_the_way`: frames that may have been sent and not tracked when the previous camera process ended.
  explicit Renumbering(int64_t num_on_the_way) : num_on_the_way_(num_on_the_way) {}

  // Gives a frame of the source its number and time in the run.
  void Apply(CameraFrame& frame) const {
    frame.id.value += number_offset_;
    frame.utime_us += time_offset_us_;
  }
  // Frame `tracked`, taken at `tracked_utime_us`, has a pose. If `frame` has no higher number, it and all later ones
  // are numbered after all frames that may be on their way; the numbers in between count as dropped.
  void MoveBehind(FrameId tracked, int64_t tracked_utime_us, CameraFrame& frame) {
    if (frame.id > tracked) return;
    const int64_t number_step = tracked.value + num_on_the_way_ + 1 - frame.id.value;
    const int64_t time_step_us = std::max<int64_t>(0, tracked_utime_us + kMissedUs - frame.utime_us);
    frame.id.value += number_step;
    frame.utime_us += time_step_us;
    number_offset_ += number_step;
    time_offset_us_ += time_step_us;
  }

 private:
  // Longer than frames on their way and a restart take, where the source's clock began anew.
  static constexpr int64_t kMissedUs = 3'000'000;

  const int64_t num_on_the_way_;
  int64_t number_offset_ = 0;
  int64_t time_offset_us_ = 0;
};

}  // namespace tessera
