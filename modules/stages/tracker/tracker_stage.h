// Wiring of the tracker: features, changes of the map and answers in; poses, keyframes and questions out. What happens
// between them stands in tracking/tracker_session.h.
#pragma once

#include "messages/end_of_stream.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"
#include "tracking/latency_watch.h"
#include "tracking/map_wait.h"
#include "tracking/tracker_session.h"

namespace tessera {

class TrackerStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit TrackerStage(StageContext& context);

 private:
  template <class Value>
  void Receive(const Topic<Value>& topic);
  void Advance();
  void Do(TrackerActions actions, int64_t began_us);
  void Publish(PoseEstimate pose, int64_t began_us);

  StageContext& context_;
  TrackerSession session_;
  MapSubscription map_;
  Publisher<PoseEstimate> poses_;
  Publisher<KeyframeObservation> keyframes_;
  Publisher<RelocalizationRequest> requests_;
  Publisher<EndOfStream> end_of_stream_;
  const Rigid3 base_from_camera_;
  MapWait wait_;
  const bool watches_latency_;  // of a live run; others may be as late as they like
  LatencyWatch latency_;
};

}  // namespace tessera
