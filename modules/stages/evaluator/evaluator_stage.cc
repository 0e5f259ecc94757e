#include "stages/evaluator/evaluator_stage.h"

#include <cmath>
#include <exception>

#include "core/errors.h"
#include "evaluation/run_files.h"
#include "wire/map_file.h"

namespace tessera {

EvaluatorStage::EvaluatorStage(StageContext& context)
    : context_(
          context.KeepJournal({kPose, kMapDelta, kMapSnapshot, kRemovedKeyframes, kGroundTruth, kEndOfStream}, {})),
      out_dir_(context.settings().Get<EvaluatorSettings>().out_dir),
      map_path_(context.settings().Get<EvaluatorSettings>().save_map),
      session_(context.name(), context.settings().Get<CameraSettings>().color),
      map_(
          context, !context.settings().Get<MapperSettings>().load_map.empty(),
          [this](const MapFollower::Delta& delta) { return session_.Receive(*delta); },
          [this] {
            session_.NoteMap(map_.needs_snapshot(), context_.now_us());
            FinishIfDone();
          }) {
  if (!out_dir_.empty()) MakeRunFolder(out_dir_);  // now, so that a wrong path is found before the run
  context.Subscribe(kPose, [this](const PoseEstimate& pose, const MessageInfo& info) {
    Result<> received = session_.Receive(pose, info.publish_us, context_.now_us());
    FinishIfDone();
    return received;
  });
  context.Subscribe(kRemovedKeyframes, [this](const RemovedInDelta& removed) {
    session_.Receive(removed);
    FinishIfDone();
  });
  if (context.settings().Get<CameraSettings>().color) {
    context.Subscribe(kColor, [this](const ColorFrame& color) { session_.Receive(color); });
  }
  context.Subscribe(kGroundTruth, [this](const GroundTruthPose& truth) { session_.Receive(truth); });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    Result<> received = session_.Receive(end, context_.now_us());
    if (received) map_.Receive(end);
    FinishIfDone();
    return received;
  });
  context.Subscribe(kStatus, [this](const StageStatus& status) { session_.Receive(status, context_.now_us()); });
  context.Every(std::chrono::milliseconds(50), [this] { FinishIfDone(); });
  if (const double period_s = context.settings().Get<EvaluatorSettings>().save_period_s; period_s > 0.0) {
    context.Every(std::chrono::milliseconds(std::llround(1e3 * period_s)), [this] {
      if (!map_.needs_snapshot()) SaveMap();
    });
  }
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
  if (!map_path_.empty()) maps.push_back({map_path_, [this](const std::string&) { SaveMap(); }});
  const Rigid3 base_from_camera = context_.settings().Get<BodySettings>().BaseFromCamera();
  for (const std::string& sentence : WriteRun(record, out_dir_, base_from_camera, maps)) context_.ReportError(sentence);
  context_.Info("wrote the run to " + out_dir_);
}

// Whole or not at all: a machine that is switched off meanwhile keeps the map that was saved before.
void EvaluatorStage::SaveMap() {
  const Map& map = session_.map();
  if (map_path_.empty() || map.keyframes().size() == 0 || map.next_delta() == saved_delta_) return;
  WriteMapFile(map, map_path_);
  saved_delta_ = map.next_delta();
}

}  // namespace tessera
