// Bounds how much is done in a time, whoever asks for it and how often. Time is passed in.
#pragma once

#include <algorithm>
#include <cstdint>

namespace tessera {

class RateLimit {
 public:
  // `per_second` on average, and `burst` at once after a pause; in any unit.
  RateLimit(double per_second, double burst) : per_second_(per_second), burst_(burst), left_(burst) {}

  // Whether so much may be done at `now_us`; then it counts as done. Never fails when the burst is all there, so that
  // what is larger than that gets its turn too.
  bool Take(double amount, int64_t now_us) {
    left_ =
        std::min(burst_, left_ + 1e-6 * per_second_ * static_cast<double>(std::max<int64_t>(0, now_us - taken_us_)));
    taken_us_ = now_us;
    if (left_ < std::min(amount, burst_)) return false;
    left_ -= amount;
    return true;
  }

 private:
  double per_second_, burst_;
  double left_;
  int64_t taken_us_ = 0;  // when left_ was right
};

}  // namespace tessera
