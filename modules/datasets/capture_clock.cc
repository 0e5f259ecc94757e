#include "datasets/capture_clock.h"

#include <algorithm>

namespace tessera {

int64_t CaptureClock::CapturedUs(int64_t stamp_us, int64_t arrival_us) {
  const bool stands_still = last_stamp_us_ == stamp_us;  // a stream without stamps
  const bool begins_anew = last_stamp_us_ && stamp_us < *last_stamp_us_;
  if (begins_anew) offsets_.clear();
  last_stamp_us_ = stamp_us;
  const bool is_of_host = has_host_stamps_ && stamp_us <= arrival_us && arrival_us - stamp_us < kMaxDelayUs;
  const int64_t captured_us =
      stands_still ? arrival_us : (is_of_host ? stamp_us : stamp_us + OffsetUs(stamp_us, arrival_us));
  last_us_ = std::max(captured_us, last_us_ + 1);
  return last_us_;
}

int64_t CaptureClock::OffsetUs(int64_t stamp_us, int64_t arrival_us) {
  const int64_t offset_us = arrival_us - stamp_us;
  // The stream's clock was set anew, or stands still.
  if (!offsets_.empty() && offset_us - offsets_.front().second > kMaxDelayUs) offsets_.clear();
  while (!offsets_.empty() && offsets_.front().first < arrival_us - kWindowUs) offsets_.pop_front();
  while (!offsets_.empty() && offsets_.back().second >= offset_us) offsets_.pop_back();
  offsets_.emplace_back(arrival_us, offset_us);
  return offsets_.front().second;
}

}  // namespace tessera
