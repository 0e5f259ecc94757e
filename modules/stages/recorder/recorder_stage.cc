#include "stages/recorder/recorder_stage.h"

#include "core/errors.h"

namespace tessera {
namespace {

std::string PathFrom(const Settings& settings) {
  std::string path = settings.Get<std::string>("recorder.path");
  if (path.empty()) {
    throw InputError("recorder.path is empty: say where the log goes with --set recorder.path=FILE");
  }
  return path;
}

}  // namespace

RecorderStage::RecorderStage(StageContext& context)
    : recorder_(context, PathFrom(context.settings()), context.settings().Get<int>("recorder.num_extractors")) {}

}  // namespace tessera
