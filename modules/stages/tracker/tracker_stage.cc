#include "stages/tracker/tracker_stage.h"

#include "core/errors.h"

namespace tessera {
namespace {

TrackerOptions OptionsFrom(const Settings& settings) {
  TrackerOptions options;
  options.sigma_px = settings.Get<double>("tracker.sigma_px");
  options.rgbd_baseline_m = settings.Get<double>("tracker.rgbd_baseline_m");
  options.num_local_keyframes = settings.Get<int>("tracker.num_local_keyframes");
  options.max_lost_frames = settings.Get<int>("tracker.max_lost_frames");
  options.keyframe.max_parallax_rad = settings.Get<double>("tracker.keyframe_max_parallax_rad");
  options.keyframe.min_seen_share = settings.Get<double>("tracker.keyframe_min_seen_share");
  options.keyframe.max_interval_s = settings.Get<double>("tracker.keyframe_max_interval_s");
  if (const std::string problem = options.Check(); !problem.empty()) {
    throw InputError(problem);
  }
  return options;
}

}  // namespace

TrackerStage::TrackerStage(StageContext& context) : context_(context), tracker_(OptionsFrom(context.settings())) {
  poses_ = context.Advertise<PoseEstimate>(kPoseChannel);
  keyframes_ = context.Advertise<KeyframeObservation>(kKeyframeChannel);
  end_of_stream_ = context.Advertise<EndOfStream>(kEndOfStreamChannel, Publishers::kMany);
  context.Subscribe<FeatureFrame>(kFeaturesChannel,
                                  [this](const FeatureFrame& features, const MessageInfo&) { OnFeatures(features); });
  context.Subscribe<EndOfStream>(kEndOfStreamChannel, [this](const EndOfStream& end, const MessageInfo&) {
    if (end.stage == "reassembler") {
      features_end_ = end;
      FinishIfDone();
    }
  });
}

void TrackerStage::OnFeatures(const FeatureFrame& features) {
  TrackingResult result;
  {
    const StepTimer timer(context_);
    result = tracker_.Track(features);
  }
  for (const KeyframeObservation& keyframe : result.keyframes) {
    keyframes_.Publish(keyframe);
  }
  poses_.Publish(result.pose);
  last_frame_ = features.frame;
  context_.SetValue("state", static_cast<double>(result.pose.state));
  context_.SetValue("keyframes", static_cast<double>(result.num_keyframes));
  context_.SetValue("landmarks", result.pose.num_landmarks);
  FinishIfDone();
}

void TrackerStage::FinishIfDone() {
  if (context_.finished() || !features_end_ || last_frame_.value + 1 < features_end_->num_frames) {
    return;
  }
  end_of_stream_.Publish({.stage = "tracker",
                          .num_frames = features_end_->num_frames,
                          .num_dropped = features_end_->num_dropped});
  context_.Finish();
}

}  // namespace tessera
