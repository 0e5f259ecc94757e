// Says, while a live source's frames are dropped, how many were and what the machine handles. The time is told.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tessera {

class Overload {
 public:
  void NoteArrival(int64_t now_us);
  void NoteDrop() { ++num_dropped_; }
  // One sentence after each period in which frames were dropped.
  std::optional<std::string> Look(int64_t now_us);

  // Long enough to tell a rate, short enough that a controller's operator hears of it.
  static constexpr int64_t kPeriodUs = 5'000'000;
  // A longer pause is none of the source's rate: it was silent.
  static constexpr int64_t kLongestPauseUs = 1'000'000;

 private:
  struct Period {
    int64_t began_us = 0;
    int64_t num_arrived = 0, num_dropped = 0;  // before it
    int64_t sending_us = 0;                    // likewise
  };

  std::optional<Period> period_;  // none before the first frame
  int64_t num_arrived_ = 0, num_dropped_ = 0;
  int64_t sending_us_ = 0;  // time in which the source sent
  int64_t last_us_ = 0;     // when the last frame came
};

}  // namespace tessera
