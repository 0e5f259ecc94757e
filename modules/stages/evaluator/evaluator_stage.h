// Wiring of the evaluator: what the stages say goes into a RunRecord, which is written once the run has
// ended (evaluation/run_end.h).
#pragma once

#include <string>

#include "evaluation/run_end.h"
#include "evaluation/run_record.h"
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
  Result<> Apply(const MapDelta& delta);
  void FinishIfDone();
  void Write();

  StageContext& context_;
  std::string out_dir_;
  RunRecord record_;
  RunEnd end_;
  MapSubscription map_;
  bool is_written_ = false;
};

}  // namespace tessera
