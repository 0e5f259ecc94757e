#include "stages/camera/camera_stage.h"

#include <algorithm>
#include <exception>

#include "core/errors.h"
#include "messages/tracking_types.h"
#include "stages/camera/log_source.h"

namespace tessera {
namespace {

// How exactly timed frames leave; small against the time between two images of any camera.
constexpr std::chrono::milliseconds kTick{2};
// Without a pose for this long, lockstep asks for help: the slowest pipeline tracks a frame in less.
constexpr int64_t kNoPoseUs = 10'000'000;

SourceOptions SourceOptionsFrom(const Settings& settings) {
  SourceOptions options;
  options.source = settings.Get<std::string>("camera.source");
  options.sensor = ParseSensor(settings.Get<std::string>("camera.sensor"));
  options.calibration_path = settings.Get<std::string>("camera.calibration");
  options.depth_unit_m = settings.Get<double>("camera.depth_unit_m");
  options.first_frame = settings.Get<int>("camera.first_frame");
  options.last_frame = settings.Get<int>("camera.last_frame");
  if (options.depth_unit_m < 0.0) {
    throw InputError("camera.depth_unit_m must not be negative; 0 takes what the source says");
  }
  return options;
}

std::unique_ptr<FrameSource> Open(const Settings& settings) {
  const SourceOptions options = SourceOptionsFrom(settings);
  return options.source.starts_with("log:") ? OpenLog(options, settings.Get<std::string>("bus.channel_prefix"))
                                            : OpenSource(options);
}

PacerOptions PacerOptionsFrom(const Settings& settings, bool is_live) {
  PacerOptions options = ParsePace(settings.Get<std::string>("camera.pace"));
  options.lockstep_window = settings.Get<int>("camera.lockstep_window");
  if (options.lockstep_window < 1) {
    throw InputError("camera.lockstep_window must be at least 1");
  }
  // Nothing answers from a log that is being written.
  if (is_live || settings.Get<std::string>("bus.main_url").starts_with("file:")) {
    options.kind = PacerOptions::Kind::kFree;
  }
  return options;
}

// Frames that the dispatcher can have taken, beyond the last one tracked.
int64_t NumOnTheWay(const Settings& settings) {
  return settings.Get<int>("dispatcher.max_queued_frames") + settings.Get<int>("dispatcher.max_frames_in_flight");
}

}  // namespace

CameraStage::CameraStage(StageContext& context)
    : context_(context),
      source_(Open(context.settings())),
      pacer_(PacerOptionsFrom(context.settings(), source_->is_live())),
      renumbering_(NumOnTheWay(context.settings())) {
  for (const std::string& note : source_->notes()) {
    context.Info(note);
  }
  calibration_ = context.Advertise(kCalibration);
  ground_truth_ = context.Advertise(kGroundTruth);
  frames_ = context.Advertise(kCamera);
  end_of_stream_ = context.Advertise(kEndOfStream);
  context.Subscribe(kPose, [this](const PoseEstimate& pose) {
    if (pose.frame > tracked_) {
      tracked_ = pose.frame;
      tracked_utime_us_ = pose.utime_us;
    }
    pacer_.MarkTracked(pose.frame);
    last_progress_us_ = context_.now_us();
  });
  context.WhenIdle([this] { return Step(); });
  context.Every(kTick, [] {});  // lets the idle task look at the clock
  context.Every(std::chrono::seconds(1), [this] { WatchPoses(); });
  context.SetValue("num_frames", static_cast<double>(source_->num_frames().value_or(0)));
  calibration_.Publish(source_->calibration());
  last_progress_us_ = context.now_us();
}

CameraStage::~CameraStage() {
  try {
    End();
  } catch (const std::exception&) {
    // Nobody is left to tell; the dispatcher's own watch notices a stream without an end.
  }
}

// One frame, if its time has come. Returns whether to go on at once.
bool CameraStage::Step() {
  if (has_ended_) {
    return false;
  }
  try {
    if (!next_) {
      ReadNext();
    }
    SkipTracked();
  } catch (const InputError& error) {
    has_ended_ = true;  // broken off: no END_OF_STREAM
    context_.Fail(error.what(), 2);
    return false;
  }
  if (!next_) {
    End();
    context_.Finish();
    return false;
  }
  if (!pacer_.MayGo(next_->utime_us, context_.now_us())) {
    return false;
  }
  SendNext();
  return true;
}

void CameraStage::ReadNext() {
  const StepTimer timer(context_);
  next_ = source_->Next();
  if (next_) renumbering_.Apply(*next_);
}

// A camera that was started again goes on behind what is tracked; what is on its way is sent once more.
void CameraStage::SkipTracked() {
  if (!next_ || next_->id > tracked_) return;
  if (source_->is_live()) {
    renumbering_.MoveBehind(tracked_, tracked_utime_us_, *next_);
    return;
  }
  source_->SkipTo({tracked_.value + 1});
  while (next_ && next_->id <= tracked_) ReadNext();
  pacer_.RestartClock();
}

void CameraStage::SendNext() {
  SendGroundTruthUpTo(next_->id);
  frames_.Publish(*next_);
  pacer_.MarkSent(next_->id);
  last_sent_ = next_->id;
  last_progress_us_ = context_.now_us();
  next_.reset();
  ++num_sent_;
  context_.SetQueue(pacer_.num_ahead());
  context_.SetValue("num_sent", static_cast<double>(num_sent_));
}

void CameraStage::SendGroundTruthUpTo(FrameId frame) {
  const std::vector<GroundTruthPose>& truths = source_->ground_truth();
  for (; num_truths_sent_ < truths.size() && truths[num_truths_sent_].frame <= frame; ++num_truths_sent_) {
    ground_truth_.Publish(truths[num_truths_sent_]);
  }
}

void CameraStage::End() {
  if (has_ended_) {
    return;
  }
  has_ended_ = true;
  last_sent_ = std::max(last_sent_, tracked_);
  SendGroundTruthUpTo(last_sent_);
  end_of_stream_.Publish({.stage = StageKind::kCamera, .num_frames = last_sent_.value + 1, .num_dropped = 0});
}

void CameraStage::WatchPoses() {
  const bool is_stuck = !has_ended_ && pacer_.num_ahead() > 0 && context_.now_us() - last_progress_us_ > kNoPoseUs;
  if (is_stuck && !warned_) {
    context_.ReportError("no pose has come for 10 s, and in lockstep frame " + std::to_string(last_sent_.value + 1) +
                         " waits for one: is the rest of the stack running?");
  }
  warned_ = is_stuck;
}

}  // namespace tessera
