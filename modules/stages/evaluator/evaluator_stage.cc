#include "stages/evaluator/evaluator_stage.h"

#include <algorithm>
#include <exception>
#include <filesystem>

#include "core/errors.h"
#include "evaluation/run_files.h"
#include "messages/stage_messages.h"
#include "messages/tracking_types.h"
#include "wire/map_file.h"

namespace tessera {
namespace {

// Each stage speaks twice a second; the figures of a run are those that it gives after the end.
constexpr int64_t kMaxWaitForStatusUs = 1'000'000;
// After the tracker's end, a pose or a change of the map that has not come for this long won't come any more; a global
// bundle adjustment of a large map takes a minute on a busy machine.
constexpr int64_t kLastNewsTimeoutUs = 120'000'000;

StageFigures FiguresOf(const StageStatus& status) {
  const StepStatistics& step = status.step;
  return {.step_ms = {step.count, step.mean_ms, step.median_ms, step.p95_ms, step.p99_ms, step.max_ms},
          .num_repaired = status.num_repaired,
          .num_lost = status.num_lost,
          .num_dropped = status.num_dropped,
          .values = {status.values.begin(), status.values.end()}};
}

}  // namespace

EvaluatorStage::EvaluatorStage(StageContext& context)
    : context_(context),
      out_dir_(context.settings().Get<std::string>("evaluator.out_dir")),
      map_(context, !context.settings().Get<std::string>("mapper.load_map").empty(), [this] { OnDeltas(); }) {
  if (!out_dir_.empty()) {
    std::error_code error;
    std::filesystem::create_directories(out_dir_, error);
    if (error) {
      throw InputError("evaluator.out_dir " + out_dir_ + " can't be made: " + error.message() +
                       "; choose another folder");
    }
  }
  context.Subscribe(kPose, [this](const PoseEstimate& pose, const MessageInfo& info) {
    record_.AddPose(pose, info.publish_us);
    last_pose_ = std::max(last_pose_, pose.frame);
    last_news_us_ = context_.now_us();
    FinishIfDone();
  });
  // One that was started again begins with a snapshot of the map, which does not hold all that poses are relative to.
  context.Subscribe(kRemovedKeyframes, [this](const RemovedInDelta& removed) {
    record_.AddRemoved(removed);
    num_removals_known_ = std::max(num_removals_known_, removed.delta + 1);
    FinishIfDone();
  });
  context.Subscribe(kGroundTruth, [this](const GroundTruthPose& truth) { record_.AddGroundTruth(truth); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) { OnEnd(end); });
  context.Subscribe(kStatus, [this](const StageStatus& status) { OnStatus(status); });
  context.Every(std::chrono::milliseconds(50), [this] { FinishIfDone(); });
}

EvaluatorStage::~EvaluatorStage() {
  if (record_.empty() && !end_) {
    return;  // the run never began
  }
  try {
    Write();
  } catch (const std::exception& error) {
    context_.ReportError(error.what());
  }
}

void EvaluatorStage::OnStatus(const StageStatus& status) {
  record_.SetStage(status.name, FiguresOf(status));
  heard_us_[status.name] = context_.now_us();
}

void EvaluatorStage::OnEnd(const EndOfStream& end) {
  if (end.stage == StageKind::kTracker && !end_) {
    end_ = end;
    record_.SetEnd(end.num_frames, end.num_dropped);
  } else if (end.stage == StageKind::kMapper && !mapper_end_) {
    mapper_end_ = end;
    map_.Expect(end.num_values);
  } else {
    return;
  }
  last_news_us_ = context_.now_us();
  FinishIfDone();
}

void EvaluatorStage::OnDeltas() {
  for (const auto& delta : map_.Take()) {
    if (const Result<> applied = record_.ApplyDelta(*delta); !applied) {
      map_.Reject(applied.error().sentence);
      break;
    }
  }
  last_news_us_ = context_.now_us();
  FinishIfDone();
}

// All poses and the whole map, or what came of them.
bool EvaluatorStage::HasAll() const {
  const bool has_poses = end_ && last_pose_.value + 1 >= end_->num_frames;
  const bool has_map = mapper_end_ && !map_.needs_snapshot() && record_.map().next_delta() >= mapper_end_->num_values &&
                       num_removals_known_ >= mapper_end_->num_values;
  return (has_poses && has_map) || (end_ && context_.now_us() - last_news_us_ > kLastNewsTimeoutUs);
}

// Every stage that was alive lately has given its figures since the run was complete.
bool EvaluatorStage::HaveAllReported() const {
  return std::all_of(heard_us_.begin(), heard_us_.end(), [&](const auto& heard) {
    return heard.first == context_.name() || heard.second > *complete_us_ ||
           heard.second < *complete_us_ - kMaxWaitForStatusUs;
  });
}

void EvaluatorStage::FinishIfDone() {
  if (is_written_ || !HasAll()) {
    return;
  }
  if (!complete_us_) {
    complete_us_ = context_.now_us();
  }
  if (!HaveAllReported() && context_.now_us() - *complete_us_ < kMaxWaitForStatusUs) {
    return;
  }
  try {
    Write();
  } catch (const InputError& error) {
    context_.Fail(error.what(), 2);
    return;
  }
  context_.Finish();
}

void EvaluatorStage::Write() {
  if (is_written_) {
    return;
  }
  is_written_ = true;  // also when it fails: trying again would fail again
  if (out_dir_.empty()) {
    return;
  }
  WriteMapFile(record_.map(), out_dir_ + "/map.tessera");
  if (const auto path = context_.settings().Get<std::string>("evaluator.save_map"); !path.empty()) {
    WriteMapFile(record_.map(), path);
  }
  WriteRun(record_, out_dir_);
  context_.Info("wrote the run to " + out_dir_);
}

}  // namespace tessera
