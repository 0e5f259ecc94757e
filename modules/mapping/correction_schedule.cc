#include "mapping/correction_schedule.h"

#include <utility>

namespace tessera {

void CorrectionSchedule::Receive(const LoopResult& result) {
  if (result.answers >= next_loop_) loops_.try_emplace(result.answers, result);
}

void CorrectionSchedule::Receive(const GlobalAdjustment& adjustment) {
  adjustments_.try_emplace(adjustment.delta, adjustment);
}

// Results of next_loop_ .. id are there. Keyframes count without gaps.
bool CorrectionSchedule::HasLoopsUpTo(KeyframeId id) const {
  for (KeyframeId needed = next_loop_; needed <= id; ++needed.value) {
    if (!loops_.contains(needed)) return false;
  }
  return true;
}

bool CorrectionSchedule::IsAdjustmentDue(KeyframeId id) const {
  if (!asked_) return false;
  const int64_t asked = asked_->keyframe.value;
  return id.value >= asked + delays_.adjustment_keyframes + asked / delays_.adjustment_growth;
}

bool CorrectionSchedule::CanProcess(KeyframeId id) const {
  const bool has_adjustment = !IsAdjustmentDue(id) || adjustments_.contains(asked_->delta);
  return has_adjustment && HasLoopsUpTo({id.value - delays_.loop_keyframes});
}

DueCorrections CorrectionSchedule::Take(KeyframeId id) {
  return TakeUpTo({id.value - delays_.loop_keyframes}, IsAdjustmentDue(id));
}

bool CorrectionSchedule::CanFinish(KeyframeId last) const {
  return HasLoopsUpTo(last) && (!asked_ || adjustments_.contains(asked_->delta));
}

DueCorrections CorrectionSchedule::TakeAll(KeyframeId last) { return TakeUpTo(last, asked_.has_value()); }

DueCorrections CorrectionSchedule::TakeUpTo(KeyframeId last_loop, bool takes_adjustment) {
  DueCorrections due;
  for (auto it = loops_.begin(); it != loops_.end() && it->first <= last_loop; it = loops_.erase(it)) {
    next_loop_ = {it->first.value + 1};
    if (it->second.matched.valid()) due.loops.push_back(std::move(it->second));
  }
  if (takes_adjustment) {
    due.adjustment = std::move(adjustments_.at(asked_->delta));
    adjustments_.erase(adjustments_.begin(), adjustments_.upper_bound(asked_->delta));
    asked_.reset();
  }
  return due;
}

}  // namespace tessera
