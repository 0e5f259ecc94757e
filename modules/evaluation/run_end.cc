#include "evaluation/run_end.h"

#include <algorithm>

namespace tessera {

bool RunEnd::NoteEnd(const EndOfStream& end, int64_t now_us) {
  const bool is_tracker = end.stage == StageKind::kTracker;
  if (!is_tracker && end.stage != StageKind::kMapper) return false;
  std::optional<EndOfStream>& known = is_tracker ? tracker_end_ : mapper_end_;
  if (known) return false;
  known = end;
  last_news_us_ = now_us;
  return true;
}

void RunEnd::NotePose(FrameId frame, int64_t now_us) {
  last_pose_ = std::max(last_pose_, frame);
  last_news_us_ = now_us;
}

void RunEnd::NoteMap(int64_t next_delta, int64_t now_us) {
  next_delta_ = next_delta;
  last_news_us_ = now_us;
}

void RunEnd::NoteRemoved(int64_t delta) { num_removals_known_ = std::max(num_removals_known_, delta + 1); }

bool RunEnd::HasAll(int64_t now_us) const {
  if (!tracker_end_) return false;
  const bool has_poses = last_pose_.value + 1 >= tracker_end_->num_frames;
  const bool has_map = mapper_end_ && std::min(next_delta_, num_removals_known_) >= mapper_end_->num_values;
  return (has_poses && has_map) || now_us - last_news_us_ > kLastNewsTimeoutUs;
}

// Every stage that was alive lately has told its figures since everything was there.
bool RunEnd::HaveAllReported() const {
  return std::all_of(heard_us_.begin(), heard_us_.end(), [&](const auto& heard) {
    return heard.first == own_name_ || heard.second > *complete_us_ ||
           heard.second < *complete_us_ - kMaxWaitForStatusUs;
  });
}

bool RunEnd::IsReached(int64_t now_us) {
  if (!HasAll(now_us)) return false;
  if (!complete_us_) complete_us_ = now_us;
  return HaveAllReported() || now_us - *complete_us_ >= kMaxWaitForStatusUs;
}

}  // namespace tessera
