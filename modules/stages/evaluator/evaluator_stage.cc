#include "stages/evaluator/evaluator_stage.h"

#include <exception>
#include <filesystem>

#include "core/errors.h"
#include "evaluation/run_files.h"
#include "messages/stage_messages.h"
#include "messages/tracking_types.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

StageFigures FiguresOf(const StageStatus& status) {
  const StepStatistics& step = status.step;
  return {.step_ms = {step.count, step.mean_ms, step.median_ms, step.p95_ms, step.p99_ms, step.max_ms},
          .num_repaired = status.num_repaired,
          .num_lost = status.num_lost,
          .num_dropped = status.num_dropped,
          .values = {status.values.begin(), status.values.end()}};
}

// Makes the folder, so that a wrong path is found before the run.
std::string OutDirFrom(const Settings& settings) {
  auto out_dir = settings.Get<std::string>("evaluator.out_dir");
  std::error_code error;
  if (!out_dir.empty()) std::filesystem::create_directories(out_dir, error);
  if (!error) return out_dir;
  throw InputError("evaluator.out_dir " + out_dir + " can't be made: " + error.message() + "; choose another folder");
}

}  // namespace

EvaluatorStage::EvaluatorStage(StageContext& context)
    : context_(context),
      out_dir_(OutDirFrom(context.settings())),
      end_(context.name()),
      map_(
          context, !context.settings().Get<std::string>("mapper.load_map").empty(),
          [this](const MapFollower::Delta& delta) { return Apply(*delta); },
          [this] {
            end_.NoteMap(map_.needs_snapshot() ? -1 : record_.map().next_delta(), context_.now_us());
            FinishIfDone();
          }) {
  context.Subscribe(kPose, [this](const PoseEstimate& pose, const MessageInfo& info) {
    record_.AddPose(pose, info.publish_us);
    end_.NotePose(pose.frame, context_.now_us());
    FinishIfDone();
  });
  // One that was started again begins with a snapshot of the map, which does not hold all that poses are relative to.
  context.Subscribe(kRemovedKeyframes, [this](const RemovedInDelta& removed) {
    record_.AddRemoved(removed);
    end_.NoteRemoved(removed.delta);
    FinishIfDone();
  });
  context.Subscribe(kGroundTruth, [this](const GroundTruthPose& truth) { record_.AddGroundTruth(truth); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    const bool is_new = end_.NoteEnd(end, context_.now_us());
    if (is_new && end.stage == StageKind::kTracker) record_.SetEnd(end.num_frames, end.num_dropped);
    map_.Receive(end);
    FinishIfDone();
  });
  context.Subscribe(kStatus, [this](const StageStatus& status) {
    record_.SetStage(status.name, FiguresOf(status));
    end_.NoteStatus(status.name, context_.now_us());
  });
  context.Every(std::chrono::milliseconds(50), [this] { FinishIfDone(); });
}

EvaluatorStage::~EvaluatorStage() {
  if (record_.empty() && !end_.has_tracker_ended()) return;  // the run never began
  try {
    Write();
  } catch (const std::exception& error) {
    context_.ReportError(error.what());
  }
}

Result<> EvaluatorStage::Apply(const MapDelta& delta) {
  TESSERA_RETURN_IF_FAILED(record_.ApplyDelta(delta));
  return {};
}

void EvaluatorStage::FinishIfDone() {
  if (is_written_ || !end_.IsReached(context_.now_us())) return;
  try {
    Write();
  } catch (const InputError& error) {
    return context_.Fail(error.what(), 2);
  }
  context_.Finish();
}

void EvaluatorStage::Write() {
  if (is_written_) return;
  is_written_ = true;  // also when it fails: trying again would fail again
  if (out_dir_.empty()) return;
  WriteMapFile(record_.map(), out_dir_ + "/map.tessera");
  if (const auto path = context_.settings().Get<std::string>("evaluator.save_map"); !path.empty()) {
    WriteMapFile(record_.map(), path);
  }
  WriteRun(record_, out_dir_);
  context_.Info("wrote the run to " + out_dir_);
}

}  // namespace tessera
