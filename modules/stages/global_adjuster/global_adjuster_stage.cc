#include "stages/global_adjuster/global_adjuster_stage.h"

#include <string>

#include "core/errors.h"
#include "optimization/global_adjustment.h"

namespace tessera {
namespace {

BundleOptions OptionsFrom(const Settings& settings) {
  BundleOptions options = GlobalBundleOptions();
  options.max_num_iterations = settings.Get<int>("global_adjuster.iterations");
  ThrowIfFailed<InputError>(options.Check(), "global_adjuster: ");
  return options;
}

}  // namespace

GlobalAdjusterStage::GlobalAdjusterStage(StageContext& context)
    : context_(context),
      options_(OptionsFrom(context.settings())),
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
    adjustments_.Publish(AdjustGlobally(replica_, delta.answers, options_));
    context_.SetValue("adjusted", static_cast<double>(++num_adjusted_));
  }
  return {};
}

}  // namespace tessera
