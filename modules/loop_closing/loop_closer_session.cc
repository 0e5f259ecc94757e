#include "loop_closing/loop_closer_session.h"

#include <string>
#include <utility>

namespace tessera {

LoopCloserSession::LoopCloserSession(std::shared_ptr<const Vocabulary> vocabulary,
                                     const LoopCloserSessionOptions& options)
    : options_(options), loop_closer_(std::move(vocabulary), options.loop_closer) {}

Result<> LoopCloserSession::Receive(const MapDelta& delta) {
  const Result<> applied = loop_closer_.ApplyDelta(delta);
  has_map_ = applied.has_value();
  TESSERA_RETURN_IF_FAILED(applied);
  if (!options_.closes_loops) return {};
  const KeyframeId id = delta.answers;
  // The session that found the loop knows; one that was started again since does not.
  if (!delta.is_snapshot && !delta.closed_loops.empty()) corrects_at_ = id;
  const bool is_new = delta.is_snapshot || (!delta.new_keyframes.empty() && delta.new_keyframes.back().id == id);
  if (id.valid() && is_new) unexamined_ = id;
  return {};
}

LoopCloserSession::State LoopCloserSession::state() const {
  if (unexamined_) return State::kMustFindLoop;
  const bool can_answer =
      has_map_ && !requests_.empty() && loop_closer_.map().answered() >= requests_.front().last_keyframe;
  return can_answer ? State::kMustAnswer : State::kIdle;
}

LoopCloserSession::Outcome LoopCloserSession::Advance() {
  switch (state()) {
    case State::kMustFindLoop:
      return FindLoop();
    case State::kMustAnswer:
      return AnswerFirst();
    case State::kIdle:
      break;
  }
  return {};
}

// A loop found on a map that another one is about to correct would be void, so it is not looked for.
LoopResult LoopCloserSession::FindLoop() {
  const KeyframeId id = *std::exchange(unexamined_, std::nullopt);
  LoopResult result;
  result.answers = id;
  if (!corrects_at_ || id >= *corrects_at_) result = loop_closer_.FindLoop(id);
  if (result.matched.valid()) corrects_at_ = {id.value + options_.loop_delay_keyframes};
  counts_.num_candidates += result.num_candidates;
  counts_.num_consistent += result.num_consistent;
  counts_.num_matched += result.num_matched;
  counts_.num_aligned += result.num_aligned;
  counts_.num_contradicted += result.num_contradicted;
  counts_.num_confirmed += result.matched.valid() ? 1 : 0;
  return result;
}

RelocalizationAnswer LoopCloserSession::AnswerFirst() {
  RelocalizationAnswer answer = loop_closer_.Relocalize(requests_.front());
  requests_.pop_front();
  ++counts_.num_asked;
  counts_.num_found += answer.reference.valid() ? 1 : 0;
  return answer;
}

}  // namespace tessera
