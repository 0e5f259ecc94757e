// Wiring of the loop closer: changes of the map and questions of a lost tracker in, loop results and answers out. What
// happens between them stands in loop_closing/loop_closer_session.h.
#pragma once

#include "loop_closing/loop_closer_session.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class LoopCloserStage {
 public:
  // Throws InputError if a setting makes no sense, or the vocabulary can't be read.
  explicit LoopCloserStage(StageContext& context);

 private:
  Result<> Apply(const MapDelta& delta);
  void Advance();
  void ShowCounts();

  StageContext& context_;
  LoopCloserSession session_;
  MapSubscription map_;
  Publisher<LoopResult> results_;
  Publisher<RelocalizationAnswer> answers_;
};

}  // namespace tessera
