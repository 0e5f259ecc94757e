// Wiring of the evaluator: what the stages say in, the files of the run out. What happens between them stands in
// evaluation/evaluator_session.h.
#pragma once

#include <string>

#include "evaluation/evaluator_session.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class EvaluatorStage {
 public:
  // Makes the run's folder. Throws InputError if it can't.
  explicit EvaluatorStage(StageContext& context);
  // Told to stop before the end, it writes what there is.
  ~EvaluatorStage();
  EvaluatorStage(const EvaluatorStage&) = delete;
  EvaluatorStage& operator=(const EvaluatorStage&) = delete;

 private:
  void FinishIfDone();
  void Write();
  void SaveMap();

  StageContext& context_;
  const std::string out_dir_;
  const std::string map_path_;  // empty: no copy of the map is kept
  EvaluatorSession session_;
  MapSubscription map_;
  int64_t saved_delta_ = -1;  // next_delta() of the map that was last saved
};

}  // namespace tessera
