#include "tracking/tracker_time.h"

#include <algorithm>
#include <utility>

namespace tessera {

void TrackerTime::Receive(Delta delta) {
  if (delta->number < next_delta_) return;
  next_delta_ = delta->number + 1;
  answered_ = delta->answers;
  held_.push_back(std::move(delta));
}

void TrackerTime::SkipTo(const MapDelta& snapshot) {
  held_.clear();
  next_delta_ = snapshot.number + 1;
  answered_ = snapshot.answers;
}

void TrackerTime::KeyframeSent(KeyframeId id, FrameId /*at*/, int64_t /*interval_us*/) { last_sent_ = id; }

std::vector<TrackerTime::Delta> TrackerTime::TakeDeltas(FrameId frame) {
  std::vector<Delta> deltas;
  while (!held_.empty() && IsDue(*held_.front(), frame)) {
    deltas.push_back(std::move(held_.front()));
    held_.pop_front();
  }
  return deltas;
}

bool TrackerTime::Ask(FrameId frame) {
  asked_ = frame;
  return true;
}

void TrackerTime::Receive(const RelocalizationAnswer& answer) {
  if (!answer_ || answer.frame > answer_->frame) answer_ = answer;
}

void LogicalTime::KeyframeSent(KeyframeId id, FrameId at, int64_t interval_us) {
  TrackerTime::KeyframeSent(id, at, interval_us);
  int64_t delay_frames = map_delay_frames_;
  if (interval_us > 0) delay_frames = std::clamp<int64_t>(kMaxMapDelay_us / interval_us, 1, map_delay_frames_);
  sent_.push_back({id, {at.value + delay_frames}});
}

std::vector<TrackerTime::Delta> LogicalTime::TakeDeltas(FrameId frame) {
  std::vector<Delta> deltas = TrackerTime::TakeDeltas(frame);
  past_due_ = LastDue(frame);
  while (!sent_.empty() && sent_.front().id <= past_due_) sent_.pop_front();
  return deltas;
}

const RelocalizationAnswer* LogicalTime::TakeAnswer(FrameId frame) {
  return asked_ == frame && IsAnswered() ? &*answer_ : nullptr;
}

KeyframeId LogicalTime::LastDue(FrameId frame) const {
  KeyframeId due = past_due_;
  for (const Sent& sent : sent_) {
    if (sent.due <= frame) due = sent.id;
  }
  return due;
}

void LiveTime::KeyframeSent(KeyframeId id, FrameId at, int64_t interval_us) {
  TrackerTime::KeyframeSent(id, at, interval_us);
  if (at != last_at_) first_of_last_ = id;
  last_at_ = at;
}

// A frame makes no keyframe before those of the frames before it are sent: only the last ones can be open in part.
bool LiveTime::IsDue(const MapDelta& delta, FrameId /*frame*/) const {
  const bool is_of_last = first_of_last_.valid() && delta.answers >= first_of_last_;
  return !is_of_last || answered_ >= last_sent_;
}

const RelocalizationAnswer* LiveTime::TakeAnswer(FrameId /*frame*/) {
  if (!asked_.valid() || !IsAnswered()) return nullptr;
  asked_ = {};
  return &*answer_;
}

bool ReplayTime::HasDeltas(FrameId frame) const {
  const auto step = recorded_.steps.find(frame);
  return step == recorded_.steps.end() || next_delta_ >= step->second || answered_ >= last_sent_;
}

bool ReplayTime::IsDue(const MapDelta& delta, FrameId frame) const {
  const auto step = recorded_.steps.find(frame);
  return step != recorded_.steps.end() && delta.number < step->second;
}

const RelocalizationAnswer* ReplayTime::TakeAnswer(FrameId frame) {
  const auto used = recorded_.relocalized_by.find(frame);
  if (used == recorded_.relocalized_by.end()) return nullptr;
  const auto answer = recorded_.relocalizations.find(used->second);
  return answer == recorded_.relocalizations.end() ? nullptr : &answer->second;
}

std::unique_ptr<TrackerTime> MakeTrackerTime(const TrackerTimeOptions& options, std::optional<RecordedSteps> recorded) {
  if (recorded && recorded->is_live) return std::make_unique<ReplayTime>(std::move(*recorded));
  if (options.is_live) return std::make_unique<LiveTime>(options.may_ask);
  return std::make_unique<LogicalTime>(options.map_delay_frames, options.may_ask);
}

}  // namespace tessera
