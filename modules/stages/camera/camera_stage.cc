#include "stages/camera/camera_stage.h"

#include <exception>
#include <memory>
#include <optional>

#include "messages/tracking_types.h"
#include "stages/camera/live_source.h"
#include "stages/camera/log_source.h"

namespace tessera {
namespace {

bool IsDevice(const std::string& source) { return source.starts_with("camera:"); }
bool IsLive(const std::string& source) { return IsDevice(source) || source.starts_with("rtsp"); }

// `first_frame`: of those that the settings name.
std::unique_ptr<FrameSource> Open(const Settings& settings, int64_t first_frame) {
  const auto camera = settings.Get<CameraSettings>();
  SourceOptions options;
  options.source = camera.source;
  options.sensor = ParseSensor(camera.sensor);
  options.calibration_path = camera.calibration;
  options.depth_unit_m = camera.depth_unit_m;
  options.first_frame = first_frame;
  options.last_frame = camera.last_frame;
  options.with_color = camera.color;
  options.min_focal_px = camera.min_focal_px;
  if (IsLive(options.source)) {
    SourceOptions all = options;
    all.first_frame = 0;
    all.last_frame = -1;
    return std::make_unique<LiveSource>(
        [all] { return OpenSource(all); },
        LiveSourceOptions{IsDevice(options.source), options.first_frame, options.last_frame});
  }
  return options.source.starts_with("log:")
             ? OpenLog(options, settings.Get<BusSettings>().channel_prefix, settings.Get<TrackerSettings>().live)
             : OpenSource(options);
}

SourceOpener OpenerOf(const Settings& settings) {
  if (IsLive(settings.Get<CameraSettings>().source)) return nullptr;
  return [&settings](FrameId first) { return Open(settings, first.value); };
}

CameraSessionOptions OptionsFrom(const Settings& settings) {
  const auto camera = settings.Get<CameraSettings>();
  const auto dispatcher = settings.Get<DispatcherSettings>();
  CameraSessionOptions options;
  options.pace = ParsePace(camera.pace);
  options.pace.lockstep_window = camera.lockstep_window;
  options.is_followed = !settings.Get<BusSettings>().main_url.starts_with("file:");  // a log that is being written
  options.with_color = camera.color;
  options.num_on_the_way = dispatcher.max_queued_frames + dispatcher.max_frames_in_flight;
  return options;
}

}  // namespace

CameraStage::CameraStage(StageContext& context)
    : context_(context),
      session_(Open(context.settings(), context.settings().Get<CameraSettings>().first_frame),
               OptionsFrom(context.settings()), context.now_us(), OpenerOf(context.settings())),
      calibration_(context.Advertise(kCalibration)),
      ground_truth_(context.Advertise(kGroundTruth)),
      frames_(context.Advertise(kCamera)),
      colors_(context.Advertise(kColor)),
      end_of_stream_(context.Advertise(kEndOfStream)) {
  for (const std::string& note : session_.source().notes()) context.Info(note);
  num_notes_told_ = session_.source().notes().size();
  if (const std::string loss = session_.source().loss(); !loss.empty()) context.ReportError(loss);
  context.Subscribe(kPose, [this](const PoseEstimate& pose) {
    Result<> marked = session_.MarkTracked(pose.frame, pose.utime_us, context_.now_us());
    if (marked && pose.is_keyframe) Do(session_.TellColor(pose.frame, pose.utime_us));
    return marked;
  });
  context.WhenIdle([this] { return Step(); });
  context.Every(std::chrono::seconds(1), [this] {
    if (const auto report = session_.Watch(context_.now_us())) context_.ReportError(*report);
    TellEvents();
  });
  TellRightTurn();
  context.SetValue("num_frames", static_cast<double>(session_.source().num_frames().value_or(0)));
  calibration_.Publish(session_.source().calibration());
}

CameraStage::~CameraStage() {
  try {
    Do(session_.End());
  } catch (const std::exception&) {
    // Nobody is left to tell; the dispatcher's own watch notices a stream without an end.
  }
}

void CameraStage::TellRightTurn() {
  constexpr double kDegree = 0.0174532925;
  const RightTurn turn = session_.source().right_turn();
  context_.SetValue("right_pitch_deg", turn.pitch / kDegree);
  context_.SetValue("right_twist_deg", turn.twist / kDegree);
}

void CameraStage::TellEvents() {
  for (const std::string& event : session_.TakeEvents()) context_.ReportError(event);
}

// Returns whether to continue at once.
bool CameraStage::Step() {
  if (const CameraActions missed = session_.TellMissedColor(); !missed.empty()) {
    Do(missed);
    return true;
  }
  const CameraSession::State state = session_.Look(context_.now_us());
  if (state == CameraSession::State::kWaits) {
    if (const auto look_us = session_.NextLookUs(context_.now_us())) context_.WakeAt(*look_us);
    return false;
  }
  if (state == CameraSession::State::kEnded) return false;
  std::optional<StepTimer> timer;
  if (state == CameraSession::State::kMustRead) timer.emplace(context_);  // the camera's own work is to decode images
  const CameraActions actions = session_.Advance(context_.now_us());
  timer.reset();
  Do(actions);
  const std::vector<std::string>& notes = session_.source().notes();
  for (; num_notes_told_ < notes.size(); ++num_notes_told_) context_.ReportError(notes[num_notes_told_]);
  return true;
}

void CameraStage::Do(const CameraActions& actions) {
  const Overloaded perform{
      [this](const GroundTruthPose& truth) { ground_truth_.Publish(truth); },
      [this](const ColorFrame& color) { colors_.Publish(color); },
      [this](const CameraFrame& frame) { frames_.Publish(frame); },
      [this](const EndOfStream& end) { end_of_stream_.Publish(end); },
      [this](const Fail& fail) { context_.Fail(fail.sentence, fail.is_user_error ? 2 : 1); },
      [this](const Finish&) { context_.Finish(); },
  };
  for (const CameraAction& action : actions) std::visit(perform, action);
  context_.SetQueue(session_.num_ahead());
  context_.SetValue("num_sent", static_cast<double>(session_.num_sent()));
}

}  // namespace tessera
