// The global adjuster: changes of the map in; after those that ask for it, bundle adjustment of the whole out.
#pragma once

#include "messages/loop_types.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class GlobalAdjusterStage {
 public:
  explicit GlobalAdjusterStage(StageContext& context);

 private:
  Result<> Apply(const MapDelta& delta);
  GlobalAdjustment Adjust(const MapDelta& asks) const;

  StageContext& context_;
  const bool polishes_;
  Map replica_;
  MapSubscription map_;
  Publisher<GlobalAdjustment> adjustments_;
  int64_t num_adjusted_ = 0;
};

}  // namespace tessera
