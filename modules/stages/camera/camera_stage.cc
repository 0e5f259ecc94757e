#include "stages/camera/camera_stage.h"

#include <exception>
#include <memory>
#include <utility>

#include "core/errors.h"
#include "messages/tracking_types.h"
#include "stages/camera/log_source.h"

namespace tessera {
namespace {

// How exactly timed frames leave; small against the time between two images of any camera.
constexpr std::chrono::milliseconds kTick{2};

std::unique_ptr<FrameSource> Open(const Settings& settings) {
  const auto camera = settings.Get<CameraSettings>();
  SourceOptions options;
  options.source = camera.source;
  options.sensor = ParseSensor(camera.sensor);
  options.calibration_path = camera.calibration;
  options.depth_unit_m = camera.depth_unit_m;
  options.first_frame = camera.first_frame;
  options.last_frame = camera.last_frame;
  return options.source.starts_with("log:") ? OpenLog(options, settings.Get<BusSettings>().channel_prefix)
                                            : OpenSource(options);
}

PacerOptions PacerOptionsFrom(const Settings& settings, bool is_live) {
  const auto camera = settings.Get<CameraSettings>();
  PacerOptions options = ParsePace(camera.pace);
  options.lockstep_window = camera.lockstep_window;
  // Nothing answers from a log that is being written.
  if (is_live || settings.Get<BusSettings>().main_url.starts_with("file:")) {
    options.kind = PacerOptions::Kind::kFree;
  }
  return options;
}

// Frames that the dispatcher can have taken, beyond the last one tracked.
int64_t NumOnTheWay(const Settings& settings) {
  const auto dispatcher = settings.Get<DispatcherSettings>();
  return dispatcher.max_queued_frames + dispatcher.max_frames_in_flight;
}

CameraSession MakeSession(const StageContext& context) {
  const Settings& settings = context.settings();
  std::unique_ptr<FrameSource> source = Open(settings);
  const PacerOptions pace = PacerOptionsFrom(settings, source->is_live());
  return {std::move(source), pace, NumOnTheWay(settings), context.now_us()};
}

}  // namespace

CameraStage::CameraStage(StageContext& context)
    : context_(context),
      session_(MakeSession(context)),
      calibration_(context.Advertise(kCalibration)),
      ground_truth_(context.Advertise(kGroundTruth)),
      frames_(context.Advertise(kCamera)),
      end_of_stream_(context.Advertise(kEndOfStream)) {
  for (const std::string& note : session_.source().notes()) context.Info(note);
  context.Subscribe(
      kPose, [this](const PoseEstimate& pose) { session_.MarkTracked(pose.frame, pose.utime_us, context_.now_us()); });
  context.WhenIdle([this] { return Step(); });
  context.Every(kTick, [] {});  // lets the idle task look at the clock
  context.Every(std::chrono::seconds(1), [this] {
    if (const auto report = session_.Watch(context_.now_us())) context_.ReportError(*report);
  });
  context.SetValue("num_frames", static_cast<double>(session_.source().num_frames().value_or(0)));
  calibration_.Publish(session_.source().calibration());
}

CameraStage::~CameraStage() {
  try {
    End();
  } catch (const std::exception&) {
    // Nobody is left to tell; the dispatcher's own watch notices a stream without an end.
  }
}

// Returns whether to continue at once.
bool CameraStage::Step() {
  switch (session_.Look(context_.now_us())) {
    case CameraSession::State::kMustRead:
      return Read();
    case CameraSession::State::kReady:
      Send();
      return true;
    case CameraSession::State::kAtEnd:
      End();
      context_.Finish();
      return false;
    case CameraSession::State::kWaits:
    case CameraSession::State::kEnded:
      break;
  }
  return false;
}

bool CameraStage::Read() {
  const StepTimer timer(context_);
  try {
    session_.Read();
  } catch (const InputError& error) {
    context_.Fail(error.what(), 2);
    return false;
  }
  return true;
}

void CameraStage::Send() {
  const CameraSession::Shipment shipment = session_.Send(context_.now_us());
  for (const GroundTruthPose& truth : shipment.truths) ground_truth_.Publish(truth);
  frames_.Publish(shipment.frame);
  context_.SetQueue(session_.num_ahead());
  context_.SetValue("num_sent", static_cast<double>(session_.num_sent()));
}

void CameraStage::End() {
  const auto ending = session_.End();
  if (!ending) return;
  for (const GroundTruthPose& truth : ending->truths) ground_truth_.Publish(truth);
  end_of_stream_.Publish(ending->end);
}

}  // namespace tessera
