#include "stages/loop_closer/loop_closer_stage.h"

#include <string>
#include <utility>

#include "core/errors.h"

namespace tessera {
namespace {

LoopCloserOptions OptionsFrom(const Settings& settings) {
  LoopCloserOptions options;
  options.verification.min_matches = settings.Get<int>("loop_closer.min_matches");
  options.verification.similarity.min_inliers = settings.Get<int>("loop_closer.min_aligned");
  options.verification.min_seen = settings.Get<int>("loop_closer.min_seen");
  options.relocalization.min_seen = settings.Get<int>("loop_closer.min_relocalized");
  options.verification.min_coverage = options.relocalization.min_coverage =
      settings.Get<double>("loop_closer.min_coverage");
  ThrowIfFailed<InputError>(options.Check(), "loop_closer: ");
  return options;
}

std::shared_ptr<const Vocabulary> VocabularyFrom(const Settings& settings) {
  const auto path = settings.Get<std::string>("loop_closer.vocabulary");
  return Vocabulary::Load(path.empty() ? TESSERA_VOCABULARY : path);
}

}  // namespace

LoopCloserStage::LoopCloserStage(StageContext& context)
    : context_(context),
      loop_closer_(VocabularyFrom(context.settings()), OptionsFrom(context.settings())),
      closes_loops_(context.settings().Get<bool>("mapper.close_loops")),
      loop_delay_keyframes_(context.settings().Get<int>("mapper.loop_delay_keyframes")),
      map_(context, true, [this] { OnDeltas(); }) {
  results_ = context.Advertise(kLoopResult);
  answers_ = context.Advertise(kRelocalization);
  context.Subscribe(kRelocalizationRequest, [this](const RelocalizationRequest& request) {
    requests_.push_back(request);
    AnswerRequests();
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage != StageKind::kMapper) return;
    mapper_end_ = end;
    map_.Expect(end.num_values);
    FinishIfDone();
  });
}

void LoopCloserStage::OnDeltas() {
  for (const auto& delta : map_.Take()) {
    if (const Result<> applied = loop_closer_.ApplyDelta(*delta); !applied) {
      map_.Reject(applied.error().sentence);
      return;
    }
    if (closes_loops_) FindLoop(*delta);
    AnswerRequests();
  }
  FinishIfDone();
}

// One result for each keyframe, on the map right after it came in. What is found on a map that a loop is about to bend
// would be void, so it is not looked for.
void LoopCloserStage::FindLoop(const MapDelta& delta) {
  const KeyframeId id = delta.answers;
  // Says nothing new, but to one that was started again since the loop was found.
  if (!delta.is_snapshot && !delta.closed_loops.empty()) bends_at_ = id;
  const bool is_new = delta.is_snapshot || (!delta.new_keyframes.empty() && delta.new_keyframes.back().id == id);
  if (!id.valid() || !is_new) return;
  LoopResult result;
  result.answers = id;
  if (!bends_at_ || id >= *bends_at_) {
    const StepTimer timer(context_);
    result = loop_closer_.FindLoop(id);
  }
  if (result.matched.valid()) bends_at_ = {id.value + loop_delay_keyframes_};
  results_.Publish(result);
  num_candidates_ += result.num_candidates;
  num_consistent_ += result.num_consistent;
  num_matched_ += result.num_matched;
  num_aligned_ += result.num_aligned;
  num_confirmed_ += result.matched.valid() ? 1 : 0;
  context_.SetValue("loop_candidates", static_cast<double>(num_candidates_));
  context_.SetValue("loop_consistent", static_cast<double>(num_consistent_));
  context_.SetValue("loop_matched", static_cast<double>(num_matched_));
  context_.SetValue("loop_aligned", static_cast<double>(num_aligned_));
  context_.SetValue("loop_confirmed", static_cast<double>(num_confirmed_));
}

// A question is about the map after the last keyframe that the tracker had sent.
void LoopCloserStage::AnswerRequests() {
  while (!requests_.empty() && loop_closer_.map().next_delta() > 0 && !map_.needs_snapshot() &&
         loop_closer_.map().answered() >= requests_.front().last_keyframe) {
    const RelocalizationRequest request = std::move(requests_.front());
    requests_.pop_front();
    const StepTimer timer(context_);
    const RelocalizationAnswer answer = loop_closer_.Relocalize(request);
    answers_.Publish(answer);
    ++num_asked_;
    num_found_ += answer.reference.valid() ? 1 : 0;
    context_.SetValue("relocalization_asked", static_cast<double>(num_asked_));
    context_.SetValue("relocalization_found", static_cast<double>(num_found_));
  }
}

void LoopCloserStage::FinishIfDone() {
  if (context_.finished() || !mapper_end_ || loop_closer_.map().next_delta() < mapper_end_->num_values) return;
  context_.Finish();
}

}  // namespace tessera
