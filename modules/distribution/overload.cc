#include "distribution/overload.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "core/time_units.h"

namespace tessera {

void Overload::NoteArrival(int64_t now_us) {
  if (period_) {
    sending_us_ += std::min(now_us - last_us_, kLongestPauseUs);
  } else {
    period_ = Period{.began_us = now_us, .num_arrived = 1};  // the first frame ends no interval
  }
  ++num_arrived_;
  last_us_ = now_us;
}

std::optional<std::string> Overload::Look(int64_t now_us) {
  if (!period_ || now_us - period_->began_us < kPeriodUs) return std::nullopt;
  const Period past = *period_;
  period_ = Period{now_us, num_arrived_, num_dropped_, sending_us_};
  if (num_dropped_ == past.num_dropped) return std::nullopt;
  const double seconds = SecondsOf(std::max<int64_t>(1, sending_us_ - past.sending_us));
  const auto arrived = static_cast<double>(num_arrived_ - past.num_arrived);
  const auto dropped = static_cast<double>(num_dropped_ - past.num_dropped);
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(),
                "dropped %lld of %lld frames: the machine handles %.1f frames a second of %.1f",
                static_cast<long long>(num_dropped_), static_cast<long long>(num_arrived_),
                (arrived - dropped) / seconds, arrived / seconds);
  return text.data();
}

}  // namespace tessera
