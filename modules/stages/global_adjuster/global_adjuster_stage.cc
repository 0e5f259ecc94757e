#include "stages/global_adjuster/global_adjuster_stage.h"

#include <string>

#include "optimization/global_adjustment.h"

namespace tessera {
GlobalAdjusterStage::GlobalAdjusterStage(StageContext& context)
    : context_(context),
      map_(
          context, true, [this](const MapFollower::Delta& delta) { return Apply(*delta); },
          [this] {
            if (map_.is_complete()) context_.Finish();
          }),
      adjustments_(context.Advertise(kGlobalAdjustment)) {
  map_.FollowToEnd();
}

Result<> GlobalAdjusterStage::Apply(const MapDelta& delta) {
  TESSERA_RETURN_IF_FAILED(replica_.Apply(delta));
  if (delta.asks_adjustment) {
    const StepTimer timer(context_);
    adjustments_.Publish(AdjustGlobally(replica_, delta.answers, GlobalBundleOptions()));
    context_.SetValue("adjusted", static_cast<double>(++num_adjusted_));
  }
  return {};
}

}  // namespace tessera
