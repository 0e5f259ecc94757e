// What a process knows of itself, and says in STATUS.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "messages/stage_messages.h"
#include "runtime/outgoing_streams.h"
#include "streams/channel_receiver.h"

namespace tessera {

// Statistics of step times; quantiles are those of core/quantile.h.
StepStatistics StatisticsOf(std::vector<float> steps_ms);

class StageFigures {
 public:
  explicit StageFigures(const StageIdentity& identity);

  void RecordStep(double milliseconds) { steps_ms_.push_back(static_cast<float>(milliseconds)); }
  void SetValue(const std::string& name, double value);
  // The status at this moment. Step statistics are computed at most once a second, unless `is_final`.
  StageStatus MakeStatus(StageState state, const StreamCounts& counts, int64_t num_undecodable, int64_t num_strangers,
                         int64_t now_us, bool is_final);

  // Counted by whoever does it.
  int64_t num_received = 0;
  int64_t num_published = 0;
  int64_t num_dropped = 0;
  int64_t queue = 0;
  std::string last_error;

 private:
  StageStatus status_;
  std::vector<float> steps_ms_;
  int64_t status_us_ = 0;      // when the last status was made
  int64_t statistics_us_ = 0;  // and the last statistics
};

}  // namespace tessera
