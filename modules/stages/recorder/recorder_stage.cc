#include "stages/recorder/recorder_stage.h"

#include <algorithm>
#include <chrono>

#include "core/errors.h"

namespace tessera {
namespace {

// Of a disk that the recording has filled, this is given back for the trajectory, tables and logs of the run.
constexpr int64_t kRoomForTheRunBytes = 64'000'000;

std::string PathFrom(const Settings& settings) {
  const auto path = settings.Get<RecorderSettings>().path;
  if (path.empty()) {
    throw InputError("recorder.path is empty: name the log to write, --set recorder.path=FILE");
  }
  return path;
}

}  // namespace

RecorderStage::RecorderStage(StageContext& context)
    : context_(context), log_(PathFrom(context.settings()), Checksums::kBeside) {
  context.SubscribeAll([this](const std::string& channel, ByteView message, int64_t arrival_us) {
    Write(channel, message, arrival_us);
  });
  context.Every(std::chrono::milliseconds(400), [this] {
    context_.SetValue("events", static_cast<double>(log_.num_events()));
    context_.SetValue("written_mb", 1e-6 * static_cast<double>(log_.num_bytes()));
  });
}

RecorderStage::~RecorderStage() {
  try {
    if (is_whole_) log_.Close();
  } catch (const InputError& error) {
    context_.Fail(error.what(), 1);
  }
}

void RecorderStage::GiveUp(const std::string& problem) {
  is_whole_ = false;
  log_.Abandon(kRoomForTheRunBytes);
  context_.ReportError(problem + "; the run continues without a recording");
  context_.SetValue("is_whole", 0.0);
}

void RecorderStage::Write(const std::string& channel, ByteView message, int64_t arrival_us) {
  if (!is_whole_) return;
  time_us_ = std::max(time_us_, arrival_us);
  try {
    log_.Write(time_us_, channel, message);
  } catch (const InputError& error) {
    GiveUp(error.what());
  }
}

}  // namespace tessera
