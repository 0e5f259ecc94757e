#include "tracking/latency_watch.h"

#include <array>
#include <cstdio>
#include <utility>

namespace tessera {
namespace {

constexpr double kShareOfNew = 0.1;  // in the moving average

}  // namespace

std::optional<std::string> LatencyWatch::Note(FrameId frame, int64_t captured_us, int64_t published_us) {
  const FrameId previous = std::exchange(last_, frame);
  const int64_t since_us = captured_us - std::exchange(last_captured_us_, captured_us);
  if (!previous.valid() || frame <= previous || since_us <= 0) return std::nullopt;
  const double interval_us = static_cast<double>(since_us) / static_cast<double>(frame.value - previous.value);
  interval_us_ += (interval_us_ == 0.0 ? 1.0 : kShareOfNew) * (interval_us - interval_us_);
  const auto latency_us = static_cast<double>(published_us - captured_us);
  const bool was_told = reported_us_ && published_us - *reported_us_ < kPeriodUs;
  if (latency_us <= kMaxIntervals * interval_us_ || was_told) return std::nullopt;
  reported_us_ = published_us;
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "the pose of frame %lld came %.0f ms after the frame was taken, %.1f frame intervals: fewer features, "
                "smaller images or a slower camera help",
                static_cast<long long>(frame.value), 1e-3 * latency_us, latency_us / interval_us_);
  return text.data();
}

}  // namespace tessera
