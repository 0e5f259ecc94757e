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
    : context_(context), options_(OptionsFrom(context.settings())), map_(context, true, [this] { OnDeltas(); }) {
  adjustments_ = context.Advertise(kGlobalAdjustment);
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage != StageKind::kMapper) return;
    mapper_end_ = end;
    map_.Expect(end.num_values);
    FinishIfDone();
  });
}

void GlobalAdjusterStage::OnDeltas() {
  for (const auto& delta : map_.Take()) {
    if (const Result<> applied = replica_.Apply(*delta); !applied) {
      map_.Reject(applied.error().sentence);
      return;
    }
    if (!delta->asks_adjustment) continue;
    const StepTimer timer(context_);
    adjustments_.Publish(AdjustGlobally(replica_, delta->answers, options_));
    context_.SetValue("adjusted", static_cast<double>(++num_adjusted_));
  }
  FinishIfDone();
}

void GlobalAdjusterStage::FinishIfDone() {
  if (context_.finished() || !mapper_end_ || replica_.next_delta() < mapper_end_->num_values) return;
  context_.Finish();
}

}  // namespace tessera
