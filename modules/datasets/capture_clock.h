// When the images of a live source were taken, by the host's clock.
//
// A camera of this machine (V4L2) stamps images with the host's monotonic clock. A stream has a clock of its own; an
// image arrives some time after it was taken, and never before, so the images that came fastest show how the two clocks
// stand to each other:
//
//   captured(k) = stamp(k) + min over the last images of (arrival - stamp)
//
// What even the fastest image took is not known by that: over a network, a part of the latency stays unseen.
// (E. Olson, "A Passive Solution to the Sensor Synchronization Problem", IROS 2010.)
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace tessera {

class CaptureClock {
 public:
  // `has_host_stamps`: stamps are of the host's monotonic clock.
  explicit CaptureClock(bool has_host_stamps) : has_host_stamps_(has_host_stamps) {}

  // When the image with this stamp, which arrived now, was taken; both in us of the host's monotonic clock, but for the
  // stamp of a stream; a stream whose stamps stand still has none. Never later than `arrival_us`, and later than the
  // image before it.
  int64_t CapturedUs(int64_t stamp_us, int64_t arrival_us);

  // Clocks drift by 0.1 ms in this time, and something fast comes within it.
  static constexpr int64_t kWindowUs = 10'000'000;
  // A stamp that is farther off is of another clock. Where stamps go back, the stream began anew.
  static constexpr int64_t kMaxDelayUs = 2'000'000;

 private:
  int64_t OffsetUs(int64_t stamp_us, int64_t arrival_us);

  const bool has_host_stamps_;
  std::deque<std::pair<int64_t, int64_t>> offsets_;  // (arrival, arrival - stamp), rising: the first is the least
  std::optional<int64_t> last_stamp_us_;
  int64_t last_us_ = 0;  // the last result
};

}  // namespace tessera
