#include "evaluation/evaluator_session.h"

namespace tessera {
namespace {

StageRecord RecordOf(const StageStatus& status) {
  const StepStatistics& step = status.step;
  return {.step_ms = {step.count, step.mean_ms, step.median_ms, step.p95_ms, step.p99_ms, step.max_ms},
          .num_repaired = status.num_repaired,
          .num_lost = status.num_lost,
          .num_dropped = status.num_dropped,
          .values = {status.values.begin(), status.values.end()}};
}

}  // namespace

void EvaluatorSession::Receive(const PoseEstimate& pose, int64_t publish_us, int64_t now_us) {
  record_.AddPose(pose, publish_us);
  end_.NotePose(pose.frame, now_us);
}

void EvaluatorSession::Receive(const RemovedInDelta& removed) {
  record_.AddRemoved(removed);
  end_.NoteRemoved(removed.delta);
}

void EvaluatorSession::Receive(const EndOfStream& end, int64_t now_us) {
  const bool is_new = end_.NoteEnd(end, now_us);
  if (is_new && end.stage == StageKind::kTracker) record_.SetEnd(end.num_frames, end.num_dropped);
}

void EvaluatorSession::Receive(const StageStatus& status, int64_t now_us) {
  record_.SetStage(status.name, RecordOf(status));
  end_.NoteStatus(status.name, now_us);
}

void EvaluatorSession::NoteMap(bool needs_snapshot, int64_t now_us) {
  end_.NoteMap(needs_snapshot ? -1 : record_.map().next_delta(), now_us);
}

const RunRecord& EvaluatorSession::TakeRecord() {
  is_written_ = true;
  return record_;
}

}  // namespace tessera
