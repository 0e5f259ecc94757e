// Wiring of the tracker: features, changes of the map and answers in; poses, keyframes and questions out. What happens
// between them stands in tracking/tracker_session.h.
#pragma once

#include <optional>

#include "messages/end_of_stream.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"
#include "tracking/tracker_session.h"

namespace tessera {

class TrackerStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit TrackerStage(StageContext& context);

 private:
  void Advance();
  void Do(const TrackerActions& actions);
  void Publish(const PoseEstimate& pose);

  StageContext& context_;
  TrackerSession session_;
  MapSubscription map_;
  Publisher<PoseEstimate> poses_;
  Publisher<KeyframeObservation> keyframes_;
  Publisher<RelocalizationRequest> requests_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<int64_t> waits_since_us_;  // the first frame could be tracked, but for what it waits for
  int64_t total_wait_us_ = 0;
  int64_t num_keyframes_ = 0;
};

}  // namespace tessera
