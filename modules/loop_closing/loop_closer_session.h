// What the loop closer does with everything that reaches it: changes of the map and questions of a lost tracker in,
// loop results and answers out. No bus, no clock.
//
// Each keyframe gets one result, on the map right after it came in; each question is answered on the map after the last
// keyframe that the tracker had sent.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <variant>

#include "core/result.h"
#include "loop_closing/loop_closer.h"

namespace tessera {

struct LoopCloserSessionOptions {
  LoopCloserOptions loop_closer;
  bool closes_loops = true;          // false: only questions are answered
  int64_t loop_delay_keyframes = 6;  // the mapper applies a loop so many keyframes later
};

// How far candidates came, summed over all keyframes, and the questions.
struct LoopCounts {
  int64_t num_candidates = 0, num_consistent = 0, num_matched = 0, num_aligned = 0, num_confirmed = 0;
  int64_t num_contradicted = 0;
  int64_t num_asked = 0, num_found = 0;
};

class LoopCloserSession {
 public:
  enum class State {
    kIdle,
    kMustFindLoop,  // Advance() says whether the newest keyframe closes a loop
    kMustAnswer,    // Advance() answers the first question
  };
  using Outcome = std::variant<std::monostate, LoopResult, RelocalizationAnswer>;  // to be published

  // Throws std::invalid_argument if the options make no sense.
  LoopCloserSession(std::shared_ptr<const Vocabulary> vocabulary, const LoopCloserSessionOptions& options);

  // The next delta, or a snapshot in place of those before it; to be called when the state is kIdle. Fails if it does
  // not fit the replica: then a snapshot is needed.
  Result<> Receive(const MapDelta& delta);
  void Receive(const RelocalizationRequest& request) { requests_.push_back(request); }

  State state() const;
  // Takes one step; nothing if the state is kIdle.
  Outcome Advance();

  const LoopCounts& counts() const { return counts_; }

 private:
  LoopResult FindLoop();
  RelocalizationAnswer AnswerFirst();

  const LoopCloserSessionOptions options_;
  LoopCloser loop_closer_;
  bool has_map_ = false;                   // the replica is one that the owner had
  std::optional<KeyframeId> unexamined_;   // the newest keyframe, without a result
  std::optional<KeyframeId> corrects_at_;  // the keyframe before which the last loop found corrects the map
  std::deque<RelocalizationRequest> requests_;
  LoopCounts counts_;
};

}  // namespace tessera
