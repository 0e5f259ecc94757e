// Wiring of the loop closer: changes of the map in, a loop result for each keyframe out; questions of a lost tracker
// in, answers out.
#pragma once

#include <deque>
#include <memory>
#include <optional>

#include "loop_closing/loop_closer.h"
#include "messages/end_of_stream.h"
#include "messages/loop_types.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class LoopCloserStage {
 public:
  // Throws InputError if a setting makes no sense, or the vocabulary can't be read.
  explicit LoopCloserStage(StageContext& context);

 private:
  void OnDeltas();
  void FindLoop(const MapDelta& delta);
  void AnswerRequests();
  void FinishIfDone();

  StageContext& context_;
  LoopCloser loop_closer_;
  const bool closes_loops_;
  const int64_t loop_delay_keyframes_;
  MapSubscription map_;
  Publisher<LoopResult> results_;
  Publisher<RelocalizationAnswer> answers_;
  std::deque<RelocalizationRequest> requests_;
  std::optional<KeyframeId> bends_at_;  // the keyframe before which the last loop found bends the map
  int64_t num_candidates_ = 0, num_consistent_ = 0, num_matched_ = 0, num_aligned_ = 0, num_confirmed_ = 0;
  int64_t num_asked_ = 0, num_found_ = 0;
  std::optional<EndOfStream> mapper_end_;
};

}  // namespace tessera
