#include "evaluation/evaluator_session.h"

#include <algorithm>
#include <string>

namespace tessera {
namespace {

// A source that is not looked at for so long, a day and a half at 30 Hz, is another one. What is written has a row for
// each frame.
constexpr int64_t kMaxFramesBetweenPoses = int64_t{1} << 22;

StageRecord RecordOf(const StageStatus& status) {
  const StepStatistics& step = status.step;
  return {.step_ms = {step.count, step.mean_ms, step.median_ms, step.p95_ms, step.p99_ms, step.max_ms},
          .num_repaired = status.num_repaired,
          .num_lost = status.num_lost,
          .num_dropped = status.num_dropped,
          .values = {status.values.begin(), status.values.end()}};
}

}  // namespace

Result<> EvaluatorSession::Receive(const PoseEstimate& pose, int64_t publish_us, int64_t now_us) {
  if (pose.frame.value > last_pose_.value + kMaxFramesBetweenPoses) {
    return Failed("its frame " + std::to_string(pose.frame.value) + " is far beyond " +
                  std::to_string(last_pose_.value) + ", the last one with a pose");
  }
  last_pose_ = std::max(last_pose_, pose.frame);
  record_.AddPose(pose, publish_us);
  end_.NotePose(pose.frame, now_us);
  return {};
}

void EvaluatorSession::Receive(const RemovedInDelta& removed) {
  record_.AddRemoved(removed);
  end_.NoteRemoved(removed.delta);
}

Result<> EvaluatorSession::Receive(const EndOfStream& end, int64_t now_us) {
  const bool knows_frames = end.stage == StageKind::kCamera || end.stage == StageKind::kTracker;
  if (knows_frames && end.num_frames <= last_pose_.value) {
    return Failed("it says that there were " + std::to_string(end.num_frames) + " frames, but frame " +
                  std::to_string(last_pose_.value) + " has a pose");
  }
  if (end.stage == StageKind::kCamera) record_.SetSource(end.num_values, end.num_frames);
  const bool is_new = end_.NoteEnd(end, now_us);
  if (is_new && end.stage == StageKind::kTracker) record_.SetEnd(end.num_frames, end.num_dropped);
  return {};
}

void EvaluatorSession::Receive(const StageStatus& status, int64_t now_us) {
  record_.SetStage(status.name, RecordOf(status));
  end_.NoteStatus(status.name, now_us);
}

void EvaluatorSession::NoteMap(bool needs_snapshot, int64_t now_us) {
  end_.NoteMap(needs_snapshot ? -1 : record_.map().next_delta(), now_us);
}

bool EvaluatorSession::HasColors(int64_t now_us) {
  if (!with_color_ || record_.colors().is_complete()) return true;
  if (!lacks_colors_us_) lacks_colors_us_ = now_us;
  return now_us - *lacks_colors_us_ >= kMaxWaitForColorsUs;
}

const RunRecord& EvaluatorSession::TakeRecord() {
  is_written_ = true;
  return record_;
}

}  // namespace tessera
