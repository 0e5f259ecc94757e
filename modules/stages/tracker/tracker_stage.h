// Wiring of the tracker: features and changes of the map in, poses and keyframes out. Frames wait here until the
// changes that they must see are there.
#pragma once

#include <deque>
#include <optional>

#include "messages/end_of_stream.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"
#include "tracking/delta_schedule.h"
#include "tracking/map_tracker.h"
#include "wire/recorded_steps.h"

namespace tessera {

class TrackerStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit TrackerStage(StageContext& context);

 private:
  void OnDeltas();
  void TrackWaiting();
  std::optional<MapTrackingResult> Step(const FeatureFrame& features);
  void Publish(MapTrackingResult& result);
  void FinishIfDone();
  bool waits_for_answers() const { return schedule_.follows_logical_time(); }
  bool FitsMap(const CameraCalibration& camera);
  bool IsAnswered() const;
  const RelocalizationAnswer* AnswerFor(FrameId frame);
  bool MayAsk(FrameId frame) const;

  StageContext& context_;
  MapTracker tracker_;
  const RecordedSteps recorded_;  // of a live run that is replayed
  DeltaSchedule schedule_;
  const bool may_ask_;
  bool awaits_loaded_map_;
  bool is_checked_ = false;  // the camera, against that of the map
  MapSubscription map_;
  Publisher<PoseEstimate> poses_;
  Publisher<KeyframeObservation> keyframes_;
  Publisher<RelocalizationRequest> requests_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<RelocalizationRequest> asked_;
  std::optional<RelocalizationAnswer> answer_;  // the last that came
  std::deque<FeatureFrame> waiting_;
  std::optional<int64_t> waits_since_us_;  // the first of them could be tracked, but for the map
  int64_t total_wait_us_ = 0;
  FrameId last_received_;
  FrameId last_frame_;  // tracked
  int64_t num_keyframes_ = 0;
  std::optional<EndOfStream> features_end_;
};

}  // namespace tessera
