#include "stages/tracker/tracker_stage.h"

#include <cmath>
#include <utility>

#include "core/errors.h"
#include "transport/recorded_steps.h"

namespace tessera {
namespace {

MapTrackerOptions OptionsFrom(const Settings& settings) {
  MapTrackerOptions options;
  options.sigma_px = settings.Get<double>("tracker.sigma_px");
  options.min_inliers = settings.Get<int>("tracker.min_inliers");
  options.max_local_keyframes = settings.Get<int>("tracker.max_local_keyframes");
  options.max_lost_us = std::llround(1e6 * settings.Get<double>("tracker.max_lost_s"));
  options.keyframes.min_share = settings.Get<double>("tracker.keyframe_min_share");
  options.keyframes.min_parallax_rad = settings.Get<double>("tracker.keyframe_min_parallax_rad");
  options.keyframes.max_interval_us = std::llround(1e6 * settings.Get<double>("tracker.keyframe_max_interval_s"));
  if (const std::string problem = options.Check(); !problem.empty()) {
    throw InputError(problem);
  }
  return options;
}

DeltaSchedule ScheduleFrom(const Settings& settings) {
  if (const auto log = settings.Get<std::string>("tracker.replay_log"); !log.empty()) {
    const RecordedSteps recorded = ReadRecordedSteps(log, settings.Get<std::string>("bus.channel_prefix"));
    if (recorded.is_live) return DeltaSchedule::Recorded(recorded.steps);
  }
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
      schedule_(ScheduleFrom(context.settings())),
      map_(context, false, [this] { OnDeltas(); }) {
  poses_ = context.Advertise<PoseEstimate>(kPoseChannel);
  keyframes_ = context.Advertise<KeyframeObservation>(kKeyframeChannel);
  end_of_stream_ = context.Advertise<EndOfStream>(kEndOfStreamChannel, Publishers::kMany);
  context.Subscribe<FeatureFrame>(kFeaturesChannel, [this](const FeatureFrame& features, const MessageInfo&) {
    waiting_.push_back(features);
    TrackWaiting();
  });
  context.Subscribe<EndOfStream>(kEndOfStreamChannel, [this](const EndOfStream& end, const MessageInfo&) {
    if (end.stage == "reassembler") {
      features_end_ = end;
      FinishIfDone();
    }
  });
}

void TrackerStage::OnDeltas() {
  for (const auto& delta : map_.Take()) {
    if (!delta->is_snapshot) {
      schedule_.Receive(delta);
    } else if (const std::string problem = tracker_.ApplyDelta(*delta); problem.empty()) {
      schedule_.SkipTo(*delta);
    } else {
      map_.Reject(problem);
    }
  }
  TrackWaiting();
}

void TrackerStage::TrackWaiting() {
  while (!waiting_.empty()) {
    const FeatureFrame& features = waiting_.front();
    if (map_.needs_snapshot() || !schedule_.CanTrack(features.frame)) {
      if (!waits_since_us_) waits_since_us_ = context_.now_us();
      break;
    }
    const int64_t map_wait_us = waits_since_us_ ? context_.now_us() - *waits_since_us_ : 0;
    std::optional<MapTrackingResult> result = Step(features);
    if (!result) continue;  // with the same frame, when a snapshot is there
    waits_since_us_.reset();
    result->pose.map_wait_us = map_wait_us;
    Publish(*result);
    waiting_.pop_front();
  }
  context_.SetQueue(static_cast<int64_t>(waiting_.size()));
  FinishIfDone();
}

// Nullopt if the replica has gone wrong: then a snapshot has been asked for.
std::optional<MapTrackingResult> TrackerStage::Step(const FeatureFrame& features) {
  const StepTimer timer(context_);
  for (const auto& delta : schedule_.Take(features.frame)) {
    if (const std::string problem = tracker_.ApplyDelta(*delta); !problem.empty()) {
      map_.Reject(problem);
      return std::nullopt;
    }
  }
  return tracker_.Track(features);
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
  end_of_stream_.Publish({.stage = "tracker",
                          .num_frames = features_end_->num_frames,
                          .num_dropped = features_end_->num_dropped,
                          .num_values = num_keyframes_});
  context_.Finish();
}

}  // namespace tessera
