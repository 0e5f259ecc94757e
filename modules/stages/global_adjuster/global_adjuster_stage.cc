#include "stages/global_adjuster/global_adjuster_stage.h"

#include <string>

#include "optimization/global_adjustment.h"

namespace tessera {
GlobalAdjusterStage::GlobalAdjusterStage(StageContext& context)
    : context_(context.KeepJournal({kMapDelta, kMapSnapshot, kEndOfStream}, {kGlobalAdjustment})),
      polishes_(context.settings().Get<MapperSettings>().polish),
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
    adjustments_.Publish(Adjust(delta));
    context_.SetValue("adjusted", static_cast<double>(++num_adjusted_));
  }
  return {};
}

// A change that no new keyframe made comes at the end of the run.
GlobalAdjustment GlobalAdjusterStage::Adjust(const MapDelta& asks) const {
  const bool is_polish = polishes_ && asks.new_keyframes.empty();
  return is_polish ? AdjustEveryPart(replica_, GlobalBundleOptions())
                   : AdjustGlobally(replica_, asks.answers, GlobalBundleOptions());
}

}  // namespace tessera
