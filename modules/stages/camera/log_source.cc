#include "stages/camera/log_source.h"

#include <deque>

#include "core/errors.h"
#include "wire/log.h"
#include "wire/recorded_steps.h"

namespace tessera {
namespace {

constexpr size_t kMaxFramesBeforeCalibration = 16;

class LogSource : public FrameSource {
 public:
  LogSource(const SourceOptions& options, const std::string& channel_prefix, bool runs_live);

  const CameraCalibration& calibration() const override { return *calibration_; }
  std::optional<int64_t> num_frames() const override;
  // Grows as the log is read: whatever was recorded before a frame is here when Next() yields it.
  const std::vector<GroundTruthPose>& ground_truth() const override { return ground_truth_; }
  std::optional<CameraFrame> Next() override;
  ColorReader TakeColor() override;
  bool is_live() const override { return false; }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string loss() const override { return reader_.loss(); }

 private:
  // A run is repeated as it went: what the dispatcher dropped then is not sent now.
  bool IsWanted(FrameId frame) const {
    return frame.value >= options_.first_frame && (options_.last_frame < 0 || frame.value < options_.last_frame) &&
           (!IsThinned() || recorded_.steps.contains(frame));
  }
  bool IsThinned() const { return recorded_.is_live || recorded_.has_drops; }
  std::optional<CameraFrame> ReadFrame();
  void CheckOptions() const;
  void ReadUntilCalibrated();
  void Take(const CameraCalibration& recorded);

  SourceOptions options_;
  LogReader reader_;
  RecordedSteps recorded_;
  std::optional<CameraCalibration> calibration_;
  std::vector<GroundTruthPose> ground_truth_;
  std::deque<CameraFrame> read_ahead_;  // on the way to the calibration
  std::vector<std::string> notes_;
  FrameId last_;  // that Next() returned
};

LogSource::LogSource(const SourceOptions& options, const std::string& channel_prefix, bool runs_live)
    : options_(options),
      reader_(options.source.substr(std::string("log:").size()), channel_prefix),
      recorded_(ReadRecordedSteps(options.source.substr(std::string("log:").size()), channel_prefix)) {
  CheckOptions();
  if (runs_live && recorded_.is_live) {
    throw InputError(options_.source + " was recorded live and is repeated as it went: leave out --live");
  }
  ReadUntilCalibrated();
}

// CALIBRATION and CAMERA travel on different buses, so that a recorder may hear the first frames before it.
void LogSource::ReadUntilCalibrated() {
  while (!calibration_ || read_ahead_.empty()) {
    std::optional<CameraFrame> frame = ReadFrame();
    if (!calibration_ && (!frame || read_ahead_.size() == kMaxFramesBeforeCalibration)) {
      throw InputError(options_.source + " has no CALIBRATION with its first frames: record the camera from its start");
    }
    if (!frame) {
      throw InputError(options_.source + " has no frames in the range " + std::to_string(options_.first_frame) + ":" +
                       (options_.last_frame < 0 ? "" : std::to_string(options_.last_frame)) + ": choose another range");
    }
    read_ahead_.push_back(std::move(*frame));
  }
}

void LogSource::CheckOptions() const {
  if (!options_.calibration_path.empty() || options_.depth_unit_m > 0.0) {
    throw InputError(options_.source +
                     " has its calibration in it, and its images are rectified by it: leave out --camera and "
                     "camera.depth_unit_m");
  }
  if (options_.first_frame < 0 || (options_.last_frame >= 0 && options_.last_frame <= options_.first_frame)) {
    throw InputError("frames " + std::to_string(options_.first_frame) + ":" + std::to_string(options_.last_frame) +
                     " are none: choose another range");
  }
}

void LogSource::Take(const CameraCalibration& recorded) {
  if (options_.sensor != SensorType::kMono && recorded.sensor != options_.sensor) {
    throw InputError(options_.source + " was recorded with --sensor " + ToString(recorded.sensor) +
                     " and can't serve --sensor " + ToString(options_.sensor) +
                     ": give what it was recorded with, or mono");
  }
  calibration_ = recorded;
  if (options_.sensor == SensorType::kMono) {
    calibration_->sensor = SensorType::kMono;
    calibration_->baseline_m = 0.0;
    calibration_->depth_unit_m = 0.0;
  }
}

std::optional<int64_t> LogSource::num_frames() const {
  const bool is_whole = options_.first_frame == 0 && options_.last_frame < 0 && !IsThinned();
  return is_whole ? std::optional(reader_.num_frames()) : std::nullopt;
}

std::optional<CameraFrame> LogSource::ReadFrame() {
  while (std::optional<LoggedValue> value = reader_.Next()) {
    if (const auto* calibration = std::get_if<CameraCalibration>(&*value); calibration != nullptr && !calibration_) {
      Take(*calibration);
    } else if (const auto* truth = std::get_if<GroundTruthPose>(&*value); truth != nullptr && IsWanted(truth->frame)) {
      ground_truth_.push_back(*truth);
    } else if (auto* frame = std::get_if<CameraFrame>(&*value); frame != nullptr && IsWanted(frame->id)) {
      return std::move(*frame);
    }
  }
  return std::nullopt;
}

ColorReader LogSource::TakeColor() {
  if (!reader_.has_colors()) return nullptr;
  return [this, frame = last_] { return reader_.ColorOf(frame); };
}

std::optional<CameraFrame> LogSource::Next() {
  std::optional<CameraFrame> frame;
  if (read_ahead_.empty()) {
    frame = ReadFrame();
  } else {
    frame = std::move(read_ahead_.front());
    read_ahead_.pop_front();
  }
  if (frame) last_ = frame->id;
  if (frame && options_.sensor == SensorType::kMono) {
    frame->sensor = SensorType::kMono;
    frame->right = {};
    frame->depth = {};
  }
  return frame;
}

}  // namespace

std::unique_ptr<FrameSource> OpenLog(const SourceOptions& options, const std::string& channel_prefix, bool runs_live) {
  return std::make_unique<LogSource>(options, channel_prefix, runs_live);
}

}  // namespace tessera
