// The global adjuster: changes of the map in; after those that ask for it, bundle adjustment of the whole out.
#pragma once

#include <optional>

#include "messages/end_of_stream.h"
#include "messages/loop_types.h"
#include "optimization/bundle_adjustment.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class GlobalAdjusterStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit GlobalAdjusterStage(StageContext& context);

 private:
  void OnDeltas();
  void FinishIfDone();

  StageContext& context_;
  const BundleOptions options_;
  Map replica_;
  MapSubscription map_;
  Publisher<GlobalAdjustment> adjustments_;
  int64_t num_adjusted_ = 0;
  std::optional<EndOfStream> mapper_end_;
};

}  // namespace tessera
