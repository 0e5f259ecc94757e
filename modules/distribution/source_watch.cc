#include "distribution/source_watch.h"

#include <array>
#include <cstdio>
#include <utility>

#include "core/time_units.h"

namespace tessera {
namespace {

std::string SecondsText(int64_t time_us) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f s", SecondsOf(time_us));
  return text.data();
}

}  // namespace

std::optional<std::string> SourceWatch::NoteFrame(int64_t now_us) {
  const int64_t silence_us = SilenceUs(now_us);
  heard_us_ = now_us;
  has_begun_ = true;
  if (!std::exchange(is_silent_, false)) return std::nullopt;
  return "images come again, after " + SecondsText(silence_us) + " of silence";
}

std::optional<std::string> SourceWatch::Look(int64_t now_us) {
  if (!heard_us_) heard_us_ = now_us;
  if (has_given_up_) return std::nullopt;
  if (give_up_us_ > 0 && ElapsedUs(now_us) >= give_up_us_) {
    has_given_up_ = true;
    return "no image for " + SecondsText(ElapsedUs(now_us)) + ": the source is given up, and the run ends";
  }
  const int64_t silence_us = SilenceUs(now_us);
  if (silence_us == 0 || std::exchange(is_silent_, true)) return std::nullopt;
  return "no image for " + SecondsText(silence_us) + ": the run waits for the source";
}

int64_t SourceWatch::SilenceUs(int64_t now_us) const {
  const int64_t elapsed_us = ElapsedUs(now_us);
  return elapsed_us >= (has_begun_ ? kSilentUs : kOpeningUs) ? elapsed_us : 0;
}

}  // namespace tessera
