#include "tracking/delta_schedule.h"

#include <algorithm>
#include <utility>

namespace tessera {

void DeltaSchedule::KeyframeSent(KeyframeId id, FrameId at) {
  last_sent_ = id;
  if (follows_logical_time()) sent_.push_back({id, at});
}

void DeltaSchedule::Receive(Delta delta) {
  if (delta->number < next_delta_) return;
  next_delta_ = delta->number + 1;
  answered_ = delta->answers;
  held_.push_back(std::move(delta));
}

void DeltaSchedule::SkipTo(const MapDelta& snapshot) {
  held_.clear();
  next_delta_ = snapshot.number + 1;
  answered_ = snapshot.answers;
}

// The last keyframe of the frames up to `frame - delay_frames`.
KeyframeId DeltaSchedule::LastDue(FrameId frame, int64_t delay_frames) const {
  KeyframeId due = past_due_;
  for (const Sent& sent : sent_) {
    if (sent.at.value > frame.value - delay_frames) break;
    due = sent.id;
  }
  return due;
}

bool DeltaSchedule::IsDue(const MapDelta& delta, FrameId frame) const {
  if (const auto* delayed = std::get_if<Delayed>(&rule_)) return delta.answers <= LastDue(frame, delayed->frames);
  if (const auto* steps = std::get_if<Steps>(&rule_)) {
    const auto step = steps->find(frame);
    return step != steps->end() && delta.number < step->second;
  }
  return true;
}

bool DeltaSchedule::CanTrack(FrameId frame) const {
  if (const auto* delayed = std::get_if<Delayed>(&rule_)) return answered_ >= LastDue(frame, delayed->frames);
  if (const auto* steps = std::get_if<Steps>(&rule_)) {
    const auto step = steps->find(frame);
    return step == steps->end() || next_delta_ >= step->second || answered_ >= last_sent_;
  }
  return true;
}

std::vector<DeltaSchedule::Delta> DeltaSchedule::Take(FrameId frame) {
  std::vector<Delta> deltas;
  while (!held_.empty() && IsDue(*held_.front(), frame)) {
    deltas.push_back(std::move(held_.front()));
    held_.pop_front();
  }
  if (const auto* delayed = std::get_if<Delayed>(&rule_)) {
    past_due_ = LastDue(frame, delayed->frames);
    while (!sent_.empty() && sent_.front().id <= past_due_) sent_.pop_front();
  }
  return deltas;
}

}  // namespace tessera
