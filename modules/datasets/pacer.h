// Decides when the next frame of a source may be sent.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>

#include "core/ids.h"

namespace tessera {

struct PacerOptions {
  enum class Kind {
    kFree,      // at once: a live source has its own pace, and a recorder takes all frames
    kLockstep,  // as fast as poses come back
    kTimed,     // by the source's timestamps
  };
  Kind kind = Kind::kLockstep;
  double speed = 1.0;       // kTimed: seconds of the source in one second of the clock
  int lockstep_window = 6;  // kLockstep: frames sent and not yet tracked; enough to keep every stage busy
};

// "lockstep", "realtime", or a speed factor > 0 such as "0.5". Throws InputError.
PacerOptions ParsePace(const std::string& text);

class Pacer {
 public:
  explicit Pacer(const PacerOptions& options) : options_(options) {}

  // Whether the frame taken at `utime_us` may be sent. The first call starts the clock of kTimed.
  bool MayGo(int64_t utime_us, int64_t now_us);
  // When time alone lets it go; nothing if that is not what it waits for.
  std::optional<int64_t> DueUs(int64_t utime_us) const;
  // How long ago the clock of kTimed reached `utime_us`, which MayGo() let go: a camera would have taken it then. 0 of
  // the others, whose frames are as new as they come.
  int64_t LatenessUs(int64_t utime_us, int64_t now_us) const;
  void MarkSent(FrameId frame);
  // This frame, and all before it, have a pose.
  void MarkTracked(FrameId frame);
  // After skipped frames: the next call of MayGo restarts the clock of kTimed.
  void RestartClock() { start_.reset(); }

  // Frames sent and not yet tracked; only kLockstep counts them.
  int num_ahead() const { return static_cast<int>(ahead_.size()); }

 private:
  struct Start {
    int64_t utime_us = 0;
    int64_t now_us = 0;
  };
  PacerOptions options_;
  std::optional<Start> start_;
  std::set<FrameId> ahead_;
};

}  // namespace tessera
