// When the mapper applies what the loop closer and the global adjuster found. The law of logical time: before keyframe
// k it applies exactly the loop results of keyframes <= k - E; an adjustment that keyframe a asked for, before keyframe
//
//   a + G + a / g                                     a larger map takes longer to adjust: g bounds the growth
//
// What comes early is held back, what is missing is waited for.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "messages/loop_types.h"

namespace tessera {

// What is due at one moment, in the order of the keyframes that it answers.
struct DueCorrections {
  std::vector<LoopResult> loops;  // those that found one
  std::optional<GlobalAdjustment> adjustment;
};

struct CorrectionDelays {
  int64_t loop_keyframes = 6;         // E
  int64_t adjustment_keyframes = 40;  // G
  int64_t adjustment_growth =
      8;  // g: what a map takes to be adjusted, where keyframes come at 5 Hz, and half as much again
};

class CorrectionSchedule {
 public:
  explicit CorrectionSchedule(const CorrectionDelays& delays) : delays_(delays) {}

  // The next keyframe that will get a loop result; those before, in a map that was loaded, have none.
  void BeginAt(KeyframeId first) { next_loop_ = first; }
  // In any order; what came before, or is too old, changes nothing.
  void Receive(const LoopResult& result);
  void Receive(const GlobalAdjustment& adjustment);
  // The map after this delta, which answers `asked`, is being adjusted; one adjustment at a time.
  void Ask(KeyframeId asked, int64_t delta) { asked_ = Asked{asked, delta}; }

  // Whether all is there that must be applied before keyframe `id`.
  bool CanProcess(KeyframeId id) const;
  // Takes it out. CanProcess(id) must hold.
  DueCorrections Take(KeyframeId id);

  // The same at the end, when `last` was the last keyframe: everything that was asked for is due.
  bool CanFinish(KeyframeId last) const;
  DueCorrections TakeAll(KeyframeId last);
  // Number of the delta that asked for an adjustment which is still on its way; nullopt: none is.
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
