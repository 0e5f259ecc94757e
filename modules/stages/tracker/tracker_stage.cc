#include "stages/tracker/tracker_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/time_units.h"
#include "wire/recorded_steps.h"

namespace tessera {
namespace {

// A loop closer that was started again did not hear the question.
constexpr std::chrono::milliseconds kAskAgain{500};

// Live, the answer to where the camera is comes when the loop closer has read the map: 2 s after the start in one of
// 2000 keyframes on two cores. A new part that began before would be somewhere, until a loop joins it.
constexpr int64_t kMaxUnlocated_us = 5'000'000;

bool BeginsWithMap(const Settings& settings) { return !settings.Get<MapperSettings>().load_map.empty(); }

bool WatchesLatency(const TrackerSettings& tracker) { return tracker.live && tracker.replay_log.empty(); }

MapTrackerOptions OptionsFrom(const TrackerSettings& settings) {
  MapTrackerOptions options;
  options.max_lost_us = std::llround(1e6 * settings.max_lost_s);
  options.makes_keyframes = !settings.localize_only;
  options.keyframes.min_share = settings.keyframe_min_share;
  options.keyframes.min_share_with_depth = settings.keyframe_min_share_with_depth;
  options.keyframes.min_parallax_rad = settings.keyframe_min_parallax_rad;
  options.keyframes.max_interval_us = std::llround(1e6 * settings.keyframe_max_interval_s);
  return options;
}

TrackerSession MakeSession(const Settings& settings) {
  const auto tracker = settings.Get<TrackerSettings>();
  std::optional<RecordedSteps> recorded;
  if (!tracker.replay_log.empty()) {
    recorded = ReadRecordedSteps(tracker.replay_log, settings.Get<BusSettings>().channel_prefix);
  }
  std::unique_ptr<TrackerTime> time =
      MakeTrackerTime({tracker.live, tracker.map_delay_frames, tracker.relocalize}, std::move(recorded));
  MapTrackerOptions options = OptionsFrom(tracker);
  if (time->is_live() && BeginsWithMap(settings)) options.max_unlocated_us = kMaxUnlocated_us;
  return {options, std::move(time), BeginsWithMap(settings)};
}

}  // namespace

TrackerStage::TrackerStage(StageContext& context)
    : context_(context.KeepJournal({kFeatures, kMapDelta, kMapSnapshot, kRelocalization, kEndOfStream},
                                   {kPose, kKeyframe, kEndOfStream})),
      session_(MakeSession(context.settings())),
      map_(
          context, BeginsWithMap(context.settings()),
          [this](const MapFollower::Delta& delta) { return session_.Receive(delta); }, [this] { Advance(); }),
      base_from_camera_(context.settings().Get<BodySettings>().BaseFromCamera()),
      watches_latency_(WatchesLatency(context.settings().Get<TrackerSettings>())) {
  if (context.has_lost_journal()) {
    throw std::runtime_error(
        "it can't continue where it was killed: its journal had been given up before, or its disk is broken");
  }
  map_.ReadAhead();
  poses_ = context.Advertise(kPose);
  keyframes_ = context.Advertise(kKeyframe);
  end_of_stream_ = context.Advertise(kEndOfStream);
  requests_ = context.Advertise(kRelocalizationRequest);
  Receive(kRelocalization);
  Receive(kFeatures);
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kReassembler) Do(session_.Receive(end), context_.now_us());
  });
  context.Every(kAskAgain, [this] {
    if (const auto* question = session_.open_question()) requests_.Publish(*question);
  });
}

template <class Value>
void TrackerStage::Receive(const Topic<Value>& topic) {
  context_.Subscribe(topic, [this](Value value) {
    session_.Receive(std::move(value));
    Advance();
  });
}

void TrackerStage::Advance() {
  while (session_.state() == TrackerSession::State::kReady) {
    const int64_t began_us = context_.now_us();
    TrackerActions actions;
    {
      const StepTimer timer(context_);
      actions = session_.Advance();
    }
    Do(std::move(actions), began_us);
  }
  if (session_.num_waiting() > 0) wait_.Begin(context_.now_us());
  context_.SetQueue(static_cast<int64_t>(session_.num_waiting()));
}

// `began_us`: when the step began.
void TrackerStage::Do(TrackerActions actions, int64_t began_us) {
  const Overloaded perform{
      [this, began_us](PoseEstimate& pose) { Publish(std::move(pose), began_us); },
      [this](const KeyframeObservation& keyframe) { keyframes_.Publish(keyframe); },
      [this](const RelocalizationRequest& request) { requests_.Publish(request); },
      [this](const EndOfStream& end) { end_of_stream_.Publish(end); },
      [this](const RejectMap& reject) { map_.Reject(reject.reason); },
      [this](const Fail& fail) { context_.Fail(fail.sentence, fail.is_user_error ? 2 : 1); },
      [this](const Finish&) { context_.Finish(); },
  };
  for (TrackerAction& action : actions) std::visit(perform, action);
  context_.SetValue("keyframes_sent", static_cast<double>(session_.num_keyframes()));
  context_.SetValue("scale_drift", session_.scale_drift());
  const Readout readout = session_.readout();
  context_.SetValue("readout_ms", 1e3 * readout.down_s);
  context_.SetValue("readout_across_ms", 1e3 * readout.across_s);
  context_.SetValue("depth_delay_ms", 1e3 * session_.depth_delay_s());
  context_.SetValue("right_delay_ms", 1e3 * session_.right_delay_s());
  context_.SetValue("images_repeated", static_cast<double>(session_.num_repeated()));
  context_.SetValue("own_body_share", session_.own_body_share());
}

void TrackerStage::Publish(PoseEstimate pose, int64_t began_us) {
  pose.map_wait_us = wait_.End(began_us);
  const int64_t now_us = context_.wall_us();
  pose.latency_us = std::max<int64_t>(0, now_us - pose.captured_us);
  pose.body = StateOfBase(pose.body, base_from_camera_);
  poses_.Publish(pose);
  if (watches_latency_) {
    if (const auto sentence = latency_.Note(pose.frame, pose.captured_us, now_us)) context_.ReportError(*sentence);
  }
  context_.SetValue("latency_ms", 1e-3 * static_cast<double>(pose.latency_us));
  context_.SetValue("state", static_cast<double>(pose.state));
  context_.SetValue("scale_sigma", pose.scale_sigma);
  context_.SetValue("map_wait_s", SecondsOf(wait_.total_us()));
}

}  // namespace tessera
