#include "stages/evaluator/evaluator_stage.h"

#include <exception>

#include "core/errors.h"
#include "evaluation/run_files.h"
#include "wire/map_file.h"

namespace tessera {

EvaluatorStage::EvaluatorStage(StageContext& context)
    : context_(context),
      out_dir_(context.settings().Get<EvaluatorSettings>().out_dir),
      session_(context.name()),
      map_(
          context, !context.settings().Get<MapperSettings>().load_map.empty(),
          [this](const MapFollower::Delta& delta) { return session_.Receive(*delta); },
          [this] {
            session_.NoteMap(map_.needs_snapshot(), context_.now_us());
            FinishIfDone();
          }) {
  if (!out_dir_.empty()) MakeRunFolder(out_dir_);  // now, so that a wrong path is found before the run
  context.Subscribe(kPose, [this](const PoseEstimate& pose, const MessageInfo& info) {
    session_.Receive(pose, info.publish_us, context_.now_us());
    FinishIfDone();
  });
  context.Subscribe(kRemovedKeyframes, [this](const RemovedInDelta& removed) {
    session_.Receive(removed);
    FinishIfDone();
  });
  context.Subscribe(kGroundTruth, [this](const GroundTruthPose& truth) { session_.Receive(truth); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    session_.Receive(end, context_.now_us());
    map_.Receive(end);
    FinishIfDone();
  });
  context.Subscribe(kStatus, [this](const StageStatus& status) { session_.Receive(status, context_.now_us()); });
  context.Every(std::chrono::milliseconds(50), [this] { FinishIfDone(); });
}

EvaluatorStage::~EvaluatorStage() {
  if (!session_.MayWrite()) return;
  try {
    Write();
  } catch (const std::exception& error) {
    context_.ReportError(error.what());
  }
}

void EvaluatorStage::FinishIfDone() {
  if (!session_.MustWrite(context_.now_us())) return;
  try {
    Write();
  } catch (const InputError& error) {
    return context_.Fail(error.what(), 1);  // the input was good, but the disk is full, say
  }
  context_.Finish();
}

void EvaluatorStage::Write() {
  const RunRecord& record = session_.TakeRecord();
  if (out_dir_.empty()) return;
  const auto write_map = [&](const std::string& path) { WriteMapFile(record.map(), path); };
  std::vector<RunFile> maps = {{out_dir_ + "/map.tessera", write_map}};
  if (const auto path = context_.settings().Get<EvaluatorSettings>().save_map; !path.empty()) {
    maps.push_back({path, write_map});
  }
  for (const std::string& sentence : WriteRun(record, out_dir_, maps)) context_.ReportError(sentence);
  context_.Info("wrote the run to " + out_dir_);
}

}  // namespace tessera
