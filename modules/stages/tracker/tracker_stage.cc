#include "stages/tracker/tracker_stage.h"

#include <cmath>
#include <utility>

#include "core/errors.h"
#include "wire/recorded_steps.h"

namespace tessera {
namespace {

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

// The log that is replayed, if there is one and it was recorded live.
RecordedSteps RecordedRun(const Settings& settings) {
  const auto log = settings.Get<std::string>("tracker.replay_log");
  if (log.empty()) return {};
  RecordedSteps recorded = ReadRecordedSteps(log, settings.Get<std::string>("bus.channel_prefix"));
  return recorded.is_live ? std::move(recorded) : RecordedSteps{};
}

DeltaSchedule ScheduleFrom(const Settings& settings, const RecordedSteps& recorded) {
  if (recorded.is_live) return DeltaSchedule::Recorded(recorded.steps);
  if (settings.Get<bool>("tracker.live")) return DeltaSchedule::Live();
  const int delay_frames = settings.Get<int>("tracker.map_delay_frames");
  if (delay_frames < 1) {
    throw InputError("tracker.map_delay_frames must be at least 1: no mapper can answer within the same frame");
  }
  return DeltaSchedule(delay_frames);
}

}  // namespace

TrackerStage::TrackerStage(StageContext& context)
    : context_(context),
      tracker_(OptionsFrom(context.settings())),
      recorded_(RecordedRun(context.settings())),
      schedule_(ScheduleFrom(context.settings(), recorded_)),
      may_ask_(context.settings().Get<bool>("tracker.relocalize")),
      awaits_loaded_map_(!context.settings().Get<std::string>("mapper.load_map").empty()),
      map_(context, awaits_loaded_map_, [this] { OnDeltas(); }) {
  poses_ = context.Advertise(kPose);
  keyframes_ = context.Advertise(kKeyframe);
  end_of_stream_ = context.Advertise(kEndOfStream);
  requests_ = context.Advertise(kRelocalizationRequest);
  context.Subscribe(kRelocalization, [this](const RelocalizationAnswer& answer) {
    if (!answer_ || answer.frame > answer_->frame) answer_ = answer;
    TrackWaiting();
  });
  // A loop closer that was started again did not hear the question.
  context.Every(kAskAgain, [this] {
    if (asked_ && !IsAnswered()) requests_.Publish(*asked_);
  });
  context.Subscribe(kFeatures, [this](const FeatureFrame& features) {
    if (features.frame <= last_received_)
      return;  // a reassembler that was started again repeats what isn't tracked yet
    last_received_ = features.frame;
    waiting_.push_back(features);
    TrackWaiting();
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kReassembler) {
      features_end_ = end;
      FinishIfDone();
    }
  });
}

void TrackerStage::OnDeltas() {
  for (const auto& delta : map_.Take()) {
    if (!delta->is_snapshot) {
      schedule_.Receive(delta);
    } else if (const Result<> applied = tracker_.ApplyDelta(*delta); applied) {
      schedule_.SkipTo(*delta);
      awaits_loaded_map_ = false;
    } else {
      map_.Reject(applied.error().sentence);
    }
  }
  TrackWaiting();
}

void TrackerStage::TrackWaiting() {
  while (!waiting_.empty()) {
    const FeatureFrame& features = waiting_.front();
    const bool awaits_answer =
        waits_for_answers() && asked_ && asked_->features.frame == features.frame && !IsAnswered();
    if (awaits_loaded_map_ || awaits_answer || map_.needs_snapshot() || !schedule_.CanTrack(features.frame)) {
      if (!waits_since_us_) waits_since_us_ = context_.now_us();
      break;
    }
    const int64_t map_wait_us = waits_since_us_ ? context_.now_us() - *waits_since_us_ : 0;
    std::optional<MapTrackingResult> result = Step(features);
    if (!result) continue;  // with the same frame, when a snapshot or an answer is there
    waits_since_us_.reset();
    result->pose.map_wait_us = map_wait_us;
    Publish(*result);
    waiting_.pop_front();
  }
  context_.SetQueue(static_cast<int64_t>(waiting_.size()));
  FinishIfDone();
}

// Nullopt if the replica has gone wrong, or if the frame must wait for an answer: what is missing has been asked for.
std::optional<MapTrackingResult> TrackerStage::Step(const FeatureFrame& features) {
  if (!FitsMap(features.calibration)) return std::nullopt;
  const StepTimer timer(context_);
  for (const auto& delta : schedule_.Take(features.frame)) {
    if (const Result<> applied = tracker_.ApplyDelta(*delta); !applied) {
      map_.Reject(applied.error().sentence);
      return std::nullopt;
    }
  }
  MapTrackingResult result = tracker_.Track(features, AnswerFor(features.frame), MayAsk(features.frame));
  if (!result.asks_relocalization) return result;
  if (recorded_.is_live) return tracker_.Track(features);
  asked_ = RelocalizationRequest{features, tracker_.last_keyframe()};
  requests_.Publish(*asked_);
  if (waits_for_answers()) return std::nullopt;
  return tracker_.Track(features);
}

// A map that was loaded must have been made with this camera.
bool TrackerStage::FitsMap(const CameraCalibration& camera) {
  if (is_checked_ || tracker_.map().keyframes().size() == 0) return true;
  is_checked_ = true;
  bool fits = true;
  tracker_.map().keyframes().ForEach(
      [&](KeyframeId, const Keyframe& keyframe) { fits &= keyframe.features->calibration == camera; });
  if (!fits) {
    context_.Fail(
        "the map that was loaded was made with another camera or sensor than this one: load a map of this "
        "camera, or begin without one",
        2);
  }
  return fits;
}

bool TrackerStage::IsAnswered() const { return asked_ && answer_ && answer_->frame == asked_->features.frame; }

// Logical time: the answer to this frame's own question. Live: the last one that came, once. Replay: the one used then.
const RelocalizationAnswer* TrackerStage::AnswerFor(FrameId frame) {
  if (recorded_.is_live) {
    const auto used = recorded_.relocalized_by.find(frame);
    if (used == recorded_.relocalized_by.end()) return nullptr;
    const auto answer = recorded_.relocalizations.find(used->second);
    return answer == recorded_.relocalizations.end() ? nullptr : &answer->second;
  }
  if (!IsAnswered() || (waits_for_answers() && answer_->frame != frame)) return nullptr;
  if (!waits_for_answers()) asked_.reset();
  return &*answer_;
}

// Once a frame, and live not before the last question was answered.
bool TrackerStage::MayAsk(FrameId frame) const {
  if (recorded_.is_live) return recorded_.relocalizations.contains(frame);
  if (waits_for_answers()) return may_ask_ && !(asked_ && asked_->features.frame == frame);
  return may_ask_ && !asked_;
}

void TrackerStage::Publish(MapTrackingResult& result) {
  PoseEstimate& pose = result.pose;
  pose.num_deltas = tracker_.map().next_delta();
  pose.is_live = !schedule_.follows_logical_time();
  for (KeyframeObservation& keyframe : result.keyframes) {
    keyframe.num_deltas = pose.num_deltas;
    schedule_.KeyframeSent(keyframe.id, pose.frame);
    keyframes_.Publish(keyframe);
  }
  poses_.Publish(pose);
  last_frame_ = pose.frame;
  num_keyframes_ += static_cast<int64_t>(result.keyframes.size());
  total_wait_us_ += pose.map_wait_us;
  context_.SetValue("state", static_cast<double>(pose.state));
  context_.SetValue("keyframes_sent", static_cast<double>(num_keyframes_));
  context_.SetValue("map_wait_s", 1e-6 * static_cast<double>(total_wait_us_));
}

void TrackerStage::FinishIfDone() {
  if (context_.finished() || !features_end_ || last_frame_.value + 1 < features_end_->num_frames) {
    return;
  }
  end_of_stream_.Publish({.stage = StageKind::kTracker,
                          .num_frames = features_end_->num_frames,
                          .num_dropped = features_end_->num_dropped,
                          .num_values = num_keyframes_});
  context_.Finish();
}

}  // namespace tessera
