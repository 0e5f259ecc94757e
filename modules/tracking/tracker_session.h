// What the tracker does with everything that reaches it: features, changes of the map, answers of the loop closer and
// the end of the stream in, actions out. No bus, no clock.
//
// Frames are tracked in order. The first of those that wait decides the state:
//
//   kAwaitsFrame     no frame waits
//   kAwaitsSnapshot  a map was loaded and is not here yet, or a delta did not fit the replica: only a snapshot helps
//   kAwaitsDeltas    the frame must see deltas that are not here yet            (LogicalTime, ReplayTime)
//   kAwaitsAnswer    the frame asked where it was taken, and waits for the answer (LogicalTime)
//   kReady           Advance() will track it
//   kFinished        the last frame of the stream is tracked
//   kFailed          the map and the camera do not belong together
//
// Inputs and Advance() are the only transitions; kFinished and kFailed are final.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "core/result.h"
#include "core/session_actions.h"
#include "messages/end_of_stream.h"
#include "messages/loop_types.h"
#include "messages/tracking_types.h"
#include "tracking/map_tracker.h"
#include "tracking/tracker_time.h"

namespace tessera {

// Values are to be published.
using TrackerAction =
    std::variant<PoseEstimate, KeyframeObservation, RelocalizationRequest, EndOfStream, RejectMap, Fail, Finish>;
using TrackerActions = std::vector<TrackerAction>;

class TrackerSession {
 public:
  enum class State { kAwaitsFrame, kAwaitsSnapshot, kAwaitsDeltas, kAwaitsAnswer, kReady, kFinished, kFailed };

  // `begins_with_map`: the mapper has loaded a map, which comes as a snapshot. Throws std::invalid_argument with
  // MapTrackerOptions::Check()'s sentence.
  TrackerSession(const MapTrackerOptions& options, std::unique_ptr<TrackerTime> time, bool begins_with_map);

  // Frames come in the order of their numbers; one that came before is ignored, since a reassembler that was started
  // again repeats what is not tracked yet.
  void Receive(FeatureFrame features);
  // The next delta, or a snapshot in place of those before it. A snapshot is applied at once, and fails if it does not
  // fit: then another one is needed.
  Result<> Receive(TrackerTime::Delta delta);
  void Receive(const RelocalizationAnswer& answer) { time_->Receive(answer); }
  // No frame after `features_end.num_frames` - 1 will come.
  TrackerActions Receive(const EndOfStream& features_end);

  // Takes one step if the state is kReady, else does nothing. The step tracks the first frame, or finds that it must
  // wait: it asked for its place, or the replica has to be replaced.
  TrackerActions Advance();

  State state() const;
  size_t num_waiting() const { return waiting_.size(); }    // frames
  int64_t num_keyframes() const { return num_keyframes_; }  // sent
  double scale_drift() const { return tracker_.scale_drift(); }
  Readout readout() const { return tracker_.times().readout(); }
  double depth_delay_s() const { return tracker_.times().depth_delay_s(); }
  double right_delay_s() const { return tracker_.times().right_delay_s(); }
  int64_t num_repeated() const { return tracker_.num_repeated(); }
  double own_body_share() const { return tracker_.own_body().share(); }
  // The question that was sent and is not answered yet, to be sent again from time to time: a loop closer that was
  // started again did not hear it. nullptr: none.
  const RelocalizationRequest* open_question() const { return time_->has_open_question() ? &question_ : nullptr; }

 private:
  bool FitsMap(const CameraCalibration& camera);
  Result<> ApplyDeltas(FrameId frame);
  std::optional<MapTrackingResult> Track(const FeatureFrame& features, TrackerActions& actions);
  void Publish(MapTrackingResult result, TrackerActions& actions);
  void EndIfDone(TrackerActions& actions);

  MapTracker tracker_;
  std::unique_ptr<TrackerTime> time_;
  std::deque<FeatureFrame> waiting_;
  FrameId last_received_;
  FrameId last_tracked_;
  int64_t last_utime_us_ = 0;       // of that frame
  RelocalizationRequest question_;  // the last that was sent
  int64_t num_keyframes_ = 0;
  std::optional<EndOfStream> features_end_;
  bool awaits_snapshot_;
  bool fits_map_ = false;  // the camera and the keyframes that the map began with
  bool has_finished_ = false;
  bool has_failed_ = false;
};

}  // namespace tessera
