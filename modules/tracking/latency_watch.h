// Tells, during a live run, that poses come late. The times are told.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/ids.h"

namespace tessera {

class LatencyWatch {
 public:
  // The pose of a frame taken at `captured_us` is published at `published_us`, both by the wall clock. Returns one
  // sentence if it is late, at most one every kPeriodUs.
  std::optional<std::string> Note(FrameId frame, int64_t captured_us, int64_t published_us);

  // One frame being extracted, one being tracked, one waiting: more is a queue.
  static constexpr double kMaxIntervals = 3.0;
  static constexpr int64_t kPeriodUs = 5'000'000;

 private:
  FrameId last_;
  int64_t last_captured_us_ = 0;
  double interval_us_ = 0.0;  // of the camera, a moving average; 0: unknown
  std::optional<int64_t> reported_us_;
};

}  // namespace tessera
