#include "loop_closing/loop_closer.h"

#include <stdexcept>
#include <utility>

#include "map/spanning_tree.h"

namespace tessera {

Result<> LoopCloserOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(candidates.Check());
  TESSERA_RETURN_IF_FAILED(verification.Check());
  TESSERA_RETURN_IF_FAILED(correction.Check());
  if (!(max_contradiction_sigmas > 0.0 && max_contradiction_sigmas_with_depth > 0.0)) {
    return Failed("a loop must be allowed to contradict the map by something");
  }
  if (!(min_share_to_join >= 0.0 && min_share_to_join <= 1.0)) {
    return Failed("min_share_to_join must be between 0 and 1");
  }
  return relocalization.Check();
}

LoopCloser::LoopCloser(std::shared_ptr<const Vocabulary> vocabulary, const LoopCloserOptions& options)
    : options_(options), vocabulary_(std::move(vocabulary)) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
}

Result<> LoopCloser::ApplyDelta(const MapDelta& delta) {
  if (delta.is_snapshot) places_ = PlaceDatabase();
  TESSERA_RETURN_IF_FAILED(map_.Apply(delta));
  for (const KeyframeId id : delta.removed_keyframes) places_.Remove(id);
  for (const MapDelta::NewKeyframe& added : delta.new_keyframes) {
    if (map_.FindKeyframe(added.id) == nullptr) continue;
    places_.Add(added.id, std::make_shared<const BagOfWords>(vocabulary_->Describe(added.features->descriptors)));
  }
  return {};
}

LoopResult LoopCloser::FindLoop(KeyframeId id) const {
  LoopResult result;
  result.answers = id;
  if (map_.FindKeyframe(id) == nullptr) return result;
  const Candidates candidates = FindLoopCandidates(map_, places_, id, options_.candidates);
  result.num_candidates = candidates.num_found;
  result.num_consistent = static_cast<int32_t>(candidates.keyframes.size());
  for (const KeyframeId candidate : candidates.keyframes) {
    VerificationSteps steps;
    std::optional<VerifiedPlace> place = VerifyPlace(map_, places_, id, candidate, options_.verification, &steps);
    result.num_matched += steps.is_matched ? 1 : 0;
    result.num_aligned += steps.is_aligned ? 1 : 0;
    if (!place) continue;
    const bool joins_parts = RootOf(map_, id) != RootOf(map_, place->matched);
    if (joins_parts && place->seen_share < options_.min_share_to_join) continue;
    std::optional<LoopCorrection> correction = ComputeCorrection(map_, id, *place, options_.correction);
    if (!correction) continue;
    const bool has_depth = Baseline(map_.FindKeyframe(id)->features->calibration) > 0.0;
    const double max_sigmas =
        has_depth ? options_.max_contradiction_sigmas_with_depth : options_.max_contradiction_sigmas;
    if (!(correction->contradiction_sigmas <= max_sigmas * place->seen_share)) {
      ++result.num_contradicted;
      continue;
    }
    result.corrections = std::move(correction->keyframes);
    result.matched = place->matched;
    result.matched_from_current = place->matched_from_current;
    result.joins_parts = joins_parts;
    result.seen = std::move(place->seen);
    break;
  }
  return result;
}

RelocalizationAnswer LoopCloser::Relocalize(const RelocalizationRequest& request) const {
  return tessera::Relocalize(map_, places_, *vocabulary_, request, options_.candidates, options_.relocalization);
}

}  // namespace tessera
