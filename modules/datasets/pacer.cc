#include "datasets/pacer.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/errors.h"

namespace tessera {

PacerOptions ParsePace(const std::string& text) {
  PacerOptions options;
  if (text == "lockstep") {
    return options;
  }
  options.kind = PacerOptions::Kind::kTimed;
  if (text == "realtime") {
    return options;
  }
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), options.speed);
  if (error != std::errc() || stop != text.data() + text.size() || !(options.speed > 0.0) ||
      !std::isfinite(options.speed)) {
    throw InputError("pace `" + text +
                     "` is not known: give lockstep, realtime or a speed factor above 0, such as 0.5");
  }
  return options;
}

bool Pacer::MayGo(int64_t utime_us, int64_t now_us) {
  switch (options_.kind) {
    case PacerOptions::Kind::kFree:
      return true;
    case PacerOptions::Kind::kLockstep:
      return num_ahead() < options_.lockstep_window;
    case PacerOptions::Kind::kTimed:
      break;
  }
  if (!start_) {
    start_ = Start{utime_us, now_us};
  }
  return now_us >= *DueUs(utime_us);
}

// due - start = (utime - first utime) / speed
std::optional<int64_t> Pacer::DueUs(int64_t utime_us) const {
  if (options_.kind != PacerOptions::Kind::kTimed || !start_) return std::nullopt;
  return start_->now_us + std::llround(static_cast<double>(utime_us - start_->utime_us) / options_.speed);
}

int64_t Pacer::LatenessUs(int64_t utime_us, int64_t now_us) const {
  return std::max<int64_t>(0, now_us - DueUs(utime_us).value_or(now_us));
}

void Pacer::MarkSent(FrameId frame) {
  if (options_.kind == PacerOptions::Kind::kLockstep) {
    ahead_.insert(frame);
  }
}

void Pacer::MarkTracked(FrameId frame) { ahead_.erase(ahead_.begin(), ahead_.upper_bound(frame)); }

}  // namespace tessera
