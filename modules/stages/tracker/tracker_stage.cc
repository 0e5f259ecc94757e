#include "stages/tracker/tracker_stage.h"

#include <cmath>
#include <memory>
#include <utility>

#include "core/errors.h"
#include "wire/recorded_steps.h"

namespace tessera {
namespace {

// A loop closer that was started again did not hear the question.
constexpr std::chrono::milliseconds kAskAgain{500};

MapTrackerOptions OptionsFrom(const Settings& settings) {
  MapTrackerOptions options;
  options.min_inliers = settings.Get<int>("tracker.min_inliers");
  options.max_local_keyframes = settings.Get<int>("tracker.max_local_keyframes");
  options.max_lost_us = std::llround(1e6 * settings.Get<double>("tracker.max_lost_s"));
  options.makes_keyframes = !settings.Get<bool>("tracker.localize_only");
  options.keyframes.min_share = settings.Get<double>("tracker.keyframe_min_share");
  options.keyframes.min_parallax_rad = settings.Get<double>("tracker.keyframe_min_parallax_rad");
  options.keyframes.max_interval_us = std::llround(1e6 * settings.Get<double>("tracker.keyframe_max_interval_s"));
  ThrowIfFailed<InputError>(options.Check(), "tracker: ");
  return options;
}

std::unique_ptr<TrackerTime> TimeFrom(const Settings& settings) {
  if (const auto log = settings.Get<std::string>("tracker.replay_log"); !log.empty()) {
    RecordedSteps recorded = ReadRecordedSteps(log, settings.Get<std::string>("bus.channel_prefix"));
    if (recorded.is_live) return std::make_unique<ReplayTime>(std::move(recorded));
  }
  const bool may_ask = settings.Get<bool>("tracker.relocalize");
  if (settings.Get<bool>("tracker.live")) return std::make_unique<LiveTime>(may_ask);
  const int delay_frames = settings.Get<int>("tracker.map_delay_frames");
  if (delay_frames < 1) {
    throw InputError("tracker.map_delay_frames must be at least 1: no mapper can answer within the same frame");
  }
  return std::make_unique<LogicalTime>(delay_frames, may_ask);
}

bool BeginsWithMap(const Settings& settings) { return !settings.Get<std::string>("mapper.load_map").empty(); }

}  // namespace

TrackerStage::TrackerStage(StageContext& context)
    : context_(context),
      session_(OptionsFrom(context.settings()), TimeFrom(context.settings()), BeginsWithMap(context.settings())),
      map_(
          context, BeginsWithMap(context.settings()),
          [this](const MapFollower::Delta& delta) { return session_.Receive(delta); }, [this] { Advance(); }) {
  poses_ = context.Advertise(kPose);
  keyframes_ = context.Advertise(kKeyframe);
  end_of_stream_ = context.Advertise(kEndOfStream);
  requests_ = context.Advertise(kRelocalizationRequest);
  context.Subscribe(kRelocalization, [this](const RelocalizationAnswer& answer) {
    session_.Receive(answer);
    Advance();
  });
  context.Subscribe(kFeatures, [this](const FeatureFrame& features) {
    session_.Receive(features);
    Advance();
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kReassembler) Do(session_.Receive(end));
  });
  context.Every(kAskAgain, [this] {
    if (const auto* question = session_.open_question()) requests_.Publish(*question);
  });
}

// Tracks what can be tracked, and measures how long the first frame waits for what it must see.
void TrackerStage::Advance() {
  while (session_.state() == TrackerSession::State::kReady) {
    TrackerActions actions;
    const int64_t now_us = context_.now_us();
    {
      const StepTimer timer(context_);
      actions = session_.Advance();
    }
    for (TrackerAction& action : actions) {
      if (auto* pose = std::get_if<PoseEstimate>(&action)) {
        pose->map_wait_us = now_us - std::exchange(waits_since_us_, std::nullopt).value_or(now_us);
      }
    }
    Do(actions);
  }
  if (session_.num_waiting() > 0 && !waits_since_us_) waits_since_us_ = context_.now_us();
  context_.SetQueue(static_cast<int64_t>(session_.num_waiting()));
}

void TrackerStage::Do(const TrackerActions& actions) {
  const Overloaded perform{
      [this](const PoseEstimate& pose) { Publish(pose); },
      [this](const KeyframeObservation& keyframe) {
        keyframes_.Publish(keyframe);
        context_.SetValue("keyframes_sent", static_cast<double>(++num_keyframes_));
      },
      [this](const RelocalizationRequest& request) { requests_.Publish(request); },
      [this](const EndOfStream& end) { end_of_stream_.Publish(end); },
      [this](const RejectMap& reject) { map_.Reject(reject.reason); },
      [this](const Fail& fail) { context_.Fail(fail.sentence, fail.is_user_error ? 2 : 1); },
      [this](const Finish&) { context_.Finish(); },
  };
  for (const TrackerAction& action : actions) std::visit(perform, action);
}

void TrackerStage::Publish(const PoseEstimate& pose) {
  poses_.Publish(pose);
  total_wait_us_ += pose.map_wait_us;
  context_.SetValue("state", static_cast<double>(pose.state));
  context_.SetValue("map_wait_s", 1e-6 * static_cast<double>(total_wait_us_));
}

}  // namespace tessera
