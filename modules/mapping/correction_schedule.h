// When the mapper applies the results of the loop closer and the global adjuster. Logical time: before keyframe k it
// applies exactly the loop results of keyframes <= k - E; an adjustment requested at keyframe a, before keyframe
//
//   a + G + a / g                                     a larger map takes longer to adjust: g bounds the growth
//
// An early result is held back, a missing one is waited for.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "messages/loop_types.h"

namespace tessera {

// The corrections that are due before a keyframe, in the order of the keyframes that they answer.
struct DueCorrections {
  std::vector<LoopResult> loops;  // only those that found a loop
  std::optional<GlobalAdjustment> adjustment;
};

struct CorrectionDelays {
  int64_t loop_keyframes = 6;         // E
  int64_t adjustment_keyframes = 40;  // G
  int64_t adjustment_growth = 8;      // g: 1.5 times the time of an adjustment, for keyframes at 5 Hz
};

class CorrectionSchedule {
 public:
  explicit CorrectionSchedule(const CorrectionDelays& delays) : delays_(delays) {}

  // The first keyframe that gets a loop result; the keyframes of a loaded map have none.
  void BeginAt(KeyframeId first) { next_loop_ = first; }
  // In any order; a repeated or outdated result changes nothing.
  void Receive(const LoopResult& result);
  void Receive(const GlobalAdjustment& adjustment);
  // An adjustment of the map after this delta, which answers `asked`, was requested. One at a time.
  void Ask(KeyframeId asked, int64_t delta) { asked_ = Asked{asked, delta}; }

  // Whether all corrections that are due before keyframe `id` have arrived.
  bool CanProcess(KeyframeId id) const;
  // Takes these corrections. CanProcess(id) must hold.
  DueCorrections Take(KeyframeId id);

  // The same after the last keyframe: all results of keyframes up to `last` and the requested adjustment are due.
  bool CanFinish(KeyframeId last) const;
  DueCorrections TakeAll(KeyframeId last);
  // Number of the delta whose requested adjustment has not been taken; nullopt: there is none.
  std::optional<int64_t> asked_delta() const { return asked_ ? std::optional(asked_->delta) : std::nullopt; }

 private:
  struct Asked {
    KeyframeId keyframe;
    int64_t delta = -1;
  };
  bool HasLoopsUpTo(KeyframeId id) const;
  bool IsAdjustmentDue(KeyframeId id) const;
  DueCorrections TakeUpTo(KeyframeId last_loop, bool takes_adjustment);

  CorrectionDelays delays_;
  KeyframeId next_loop_{0};
  std::map<KeyframeId, LoopResult> loops_;
  std::optional<Asked> asked_;
  std::map<int64_t, GlobalAdjustment> adjustments_;  // by delta
};

}  // namespace tessera
