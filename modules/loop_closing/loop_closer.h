// The loop closer's steps: whether a keyframe shows an earlier place, and where an image of a lost camera was taken. No
// bus, no clock.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "core/result.h"
#include "loop_closing/loop_correction.h"
#include "loop_closing/place_candidates.h"
#include "loop_closing/place_verification.h"
#include "loop_closing/relocalization.h"
#include "map/map.h"
#include "messages/loop_types.h"
#include "place_recognition/place_database.h"
#include "place_recognition/vocabulary.h"

namespace tessera {

struct LoopCloserOptions {
  CandidateOptions candidates;
  VerificationOptions verification;
  CorrectionOptions correction;
  RelocalizationOptions relocalization;
  // A place may contradict the map (LoopCorrection) by this times the share of its landmarks that are seen: by 150 to
  // 1500 standard deviations. Streets with the same cars parked at the same distances, 276 m and a right angle apart:
  // 5500.
  double max_contradiction_sigmas = 3000.0;
  // The same where depth is measured, so that no scale slips: by 6 to 20. A lorry that was followed for long, and looks
  // the same after each kilometer: 2700 to 4300.
  double max_contradiction_sigmas_with_depth = 300.0;
  // Of a place in another part of the map: nothing is known between the two, so that nothing could contradict.
  double min_share_to_join = 0.1;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Answers are pure functions of the map and the request: a loop closer that is restarted and gets the same map gives
// the same answers.
class LoopCloser {
 public:
  // Throws std::invalid_argument with Check()'s sentence.
  LoopCloser(std::shared_ptr<const Vocabulary> vocabulary, const LoopCloserOptions& options);

  // Applies the mapper's next change to the replica; fails as Map::Apply does.
  Result<> ApplyDelta(const MapDelta& delta);

  // Whether keyframe `id` shows an earlier place, in the present map. "No loop" if it is no longer there.
  LoopResult FindLoop(KeyframeId id) const;
  // Where the image was taken, in the present map.
  RelocalizationAnswer Relocalize(const RelocalizationRequest& request) const;

  const Map& map() const { return map_; }

 private:
  const LoopCloserOptions options_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  Map map_;
  PlaceDatabase places_;  // of all keyframes of the map
};

}  // namespace tessera
