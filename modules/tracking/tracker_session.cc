#include "tracking/tracker_session.h"

#include <cmath>
#include <utility>

namespace tessera {

TrackerSession::TrackerSession(const MapTrackerOptions& options, std::unique_ptr<TrackerTime> time,
                               bool begins_with_map)
    : tracker_(options), time_(std::move(time)), awaits_snapshot_(begins_with_map) {}

TrackerSession::State TrackerSession::state() const {
  if (has_failed_) return State::kFailed;
  if (has_finished_) return State::kFinished;
  if (waiting_.empty()) return State::kAwaitsFrame;
  if (awaits_snapshot_) return State::kAwaitsSnapshot;
  const FrameId frame = waiting_.front().frame;
  if (time_->AwaitsAnswer(frame)) return State::kAwaitsAnswer;
  return time_->HasDeltas(frame) ? State::kReady : State::kAwaitsDeltas;
}

void TrackerSession::Receive(FeatureFrame features) {
  if (features.frame <= last_received_) return;
  last_received_ = features.frame;
  waiting_.push_back(std::move(features));
}

Result<> TrackerSession::Receive(TrackerTime::Delta delta) {
  if (!delta->is_snapshot) {
    time_->Receive(std::move(delta));
    return {};
  }
  const Result<> applied = tracker_.ApplyDelta(*delta);
  awaits_snapshot_ = !applied;
  TESSERA_RETURN_IF_FAILED(applied);
  time_->SkipTo(*delta);
  return {};
}

TrackerActions TrackerSession::Receive(const EndOfStream& features_end) {
  features_end_ = features_end;
  TrackerActions actions;
  EndIfDone(actions);
  return actions;
}

TrackerActions TrackerSession::Advance() {
  if (state() != State::kReady) return {};
  const FeatureFrame& features = waiting_.front();
  if (!FitsMap(features.calibration)) {
    has_failed_ = true;
    return {Fail{.sentence = "the map that was loaded was made with another camera or sensor than this one: load a map "
                             "of this camera, or begin without one",
                 .is_user_error = true}};
  }
  if (const auto applied = ApplyDeltas(features.frame); !applied) {
    awaits_snapshot_ = true;
    return {RejectMap{applied.error().sentence}};
  }
  TrackerActions actions;
  if (std::optional<MapTrackingResult> result = Track(features, actions)) {
    Publish(std::move(*result), actions);
    waiting_.pop_front();
    EndIfDone(actions);
  }
  return actions;
}

// The map that the session begins with, if any, must have been made with this camera.
bool TrackerSession::FitsMap(const CameraCalibration& camera) {
  if (fits_map_ || tracker_.map().keyframes().size() == 0) return true;
  const LensCorrection& lens = tracker_.map().lens();
  fits_map_ = std::abs(FocalError(lens, camera)) <= kMaxFocalError;
  const CameraCalibration seen = WithLens(camera, lens);
  tracker_.map().keyframes().ForEach(
      [&](KeyframeId, const Keyframe& keyframe) { fits_map_ &= keyframe.features->calibration == seen; });
  return fits_map_;
}

Result<> TrackerSession::ApplyDeltas(FrameId frame) {
  for (const TrackerTime::Delta& delta : time_->TakeDeltas(frame)) {
    TESSERA_RETURN_IF_FAILED(tracker_.ApplyDelta(*delta));
  }
  return {};
}

// nullopt: the frame asked where it was taken, and waits for the answer.
std::optional<MapTrackingResult> TrackerSession::Track(const FeatureFrame& features, TrackerActions& actions) {
  const bool may_ask = time_->MayAsk(features.frame);  // before an answer is taken: a frame that has one asks no more
  MapTrackingResult result = tracker_.Track(features, time_->TakeAnswer(features.frame), may_ask);
  if (!result.asks_relocalization) return result;
  if (time_->Ask(features.frame)) {
    question_ = {tracker_.own_body().Without(features), tracker_.last_keyframe()};
    actions.emplace_back(question_);
  }
  if (time_->AwaitsAnswer(features.frame)) return std::nullopt;
  return tracker_.Track(features);
}

void TrackerSession::Publish(MapTrackingResult result, TrackerActions& actions) {
  PoseEstimate& pose = result.pose;
  const int64_t interval_us = last_tracked_.valid() ? pose.utime_us - last_utime_us_ : 0;
  pose.num_deltas = tracker_.map().next_delta();
  pose.is_live = time_->is_live();
  for (KeyframeObservation& keyframe : result.keyframes) {
    keyframe.num_deltas = pose.num_deltas;
    time_->KeyframeSent(keyframe.id, pose.frame, interval_us);
    actions.emplace_back(std::move(keyframe));
    ++num_keyframes_;
  }
  last_tracked_ = pose.frame;
  last_utime_us_ = pose.utime_us;
  actions.emplace_back(std::move(pose));
}

void TrackerSession::EndIfDone(TrackerActions& actions) {
  if (has_finished_ || !features_end_ || last_tracked_.value + 1 < features_end_->num_frames) return;
  has_finished_ = true;
  actions.emplace_back(EndOfStream{.stage = StageKind::kTracker,
                                   .num_frames = features_end_->num_frames,
                                   .num_dropped = features_end_->num_dropped,
                                   .num_values = num_keyframes_});
  actions.emplace_back(Finish{});
}

}  // namespace tessera
