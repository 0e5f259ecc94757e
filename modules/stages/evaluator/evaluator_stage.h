// Wiring of the evaluator: what the stages say goes into a RunRecord, which is written once the run has
// ended.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

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
  void OnStatus(const StageStatus& status);
  void OnEnd(const EndOfStream& end);
  void OnDeltas();
  bool HasAll() const;
  bool HaveAllReported() const;
  void FinishIfDone();
  void Write();

  StageContext& context_;
  std::string out_dir_;
  RunRecord record_;
  MapSubscription map_;
  std::optional<EndOfStream> end_;  // the tracker's
  std::optional<EndOfStream> mapper_end_;
  FrameId last_pose_;
  int64_t num_removals_known_ = 0;           // what deltas below this number removed is known
  int64_t last_news_us_ = 0;                 // when the last pose, change of the map or end came
  std::optional<int64_t> complete_us_;       // when the ends, all poses and the whole map were there
  std::map<std::string, int64_t> heard_us_;  // by stage: when its last status came
  bool is_written_ = false;
};

}  // namespace tessera
