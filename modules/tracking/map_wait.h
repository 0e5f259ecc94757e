// How long frames wait for the step of the map that they must see. For measuring only: no result depends on it.
#pragma once

#include <cstdint>
#include <optional>

namespace tessera {

class MapWait {
 public:
  // The first frame could be tracked, but for what it waits for. Only the first call since End() counts.
  void Begin(int64_t now_us) {
    if (!since_us_) since_us_ = now_us;
  }
  // Its wait is over. Returns how long it was: 0 if it never began.
  int64_t End(int64_t now_us) {
    const int64_t wait_us = now_us - since_us_.value_or(now_us);
    since_us_.reset();
    total_us_ += wait_us;
    return wait_us;
  }
  // Of all frames.
  int64_t total_us() const { return total_us_; }

 private:
  std::optional<int64_t> since_us_;
  int64_t total_us_ = 0;
};

}  // namespace tessera
