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
    : context_(context.KeepJournal({}, {})) {  // it holds nothing but that there was an earlier life
  const std::string path = PathFrom(context.settings());
  if (context.was_restarted()) {
    Continue(path);
  } else {
    log_ = std::make_unique<LogFileWriter>(path, Checksums::kBeside);
  }
  context.SubscribeAll([this](const std::string& channel, ByteView message, int64_t arrival_us) {
    Write(channel, message, arrival_us);
  });
  context.Every(std::chrono::milliseconds(400), [this] {
    if (!log_) return;
    context_.SetValue("events", static_cast<double>(log_->num_events()));
    context_.SetValue("written_mb", 1e-6 * static_cast<double>(log_->num_bytes()));
  });
}

RecorderStage::~RecorderStage() {
  try {
    if (log_) log_->Close();
  } catch (const InputError& error) {
    context_.Fail(error.what(), 1);
  }
}

void RecorderStage::Continue(const std::string& path) {
  if (!LogFileWriter::CanContinue(path)) return GiveUp("the log can't be continued where it was killed");
  log_ = std::make_unique<LogFileWriter>(path, [this](const LogEvent& event) {
    time_us_ = event.time_us;
    context_.ContinueBehind(event.channel, event.data);
  });
}

void RecorderStage::GiveUp(const std::string& problem) {
  if (log_) log_->Abandon(kRoomForTheRunBytes);
  log_.reset();
  context_.ReportError(problem + "; the run continues without a recording");
  context_.SetValue("is_whole", 0.0);
}

void RecorderStage::Write(const std::string& channel, ByteView message, int64_t arrival_us) {
  if (!log_) return;
  time_us_ = std::max(time_us_, arrival_us);
  try {
    log_->Write(time_us_, channel, message);
  } catch (const InputError& error) {
    GiveUp(error.what());
  }
}

}  // namespace tessera
