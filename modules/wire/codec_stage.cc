// STATUS.
#include <algorithm>
#include <cmath>

#include "messages/stage_messages.h"
#include "tessera/stage_status_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

// So that a status is one message also on a LAN.
constexpr size_t kMaxSentenceLength = 300;
constexpr size_t kMaxValues = 1000;

}  // namespace

template <>
struct Codec<StageStatus> {
  using Message = stage_status_t;
  static constexpr const char* kTypeName = "stage_status_t";

  template <class Emit>
  static void Cut(const StageStatus& status, Message* message, size_t max_bytes, Emit emit) {
    message->name = Printable(status.name);
    message->host = Printable(status.host);
    message->version = Printable(status.version);
    message->pid = status.pid;
    message->stage_epoch_us = status.epoch_us;
    message->state = static_cast<int8_t>(status.state);
    message->num_received = status.num_received;
    message->num_published = status.num_published;
    message->num_dropped = status.num_dropped;
    message->num_repaired = status.num_repaired;
    message->num_lost = status.num_lost;
    message->num_undecodable = status.num_undecodable;
    message->queue = status.queue;
    SetStep(status.step, message);
    message->cpu_percent = status.cpu_percent;
    message->cpu_s = status.cpu_s;
    message->rss_mb = status.rss_mb;
    message->last_error = Printable(status.last_error.substr(0, kMaxSentenceLength));
    auto room = static_cast<int64_t>(max_bytes) - message->getEncodedSize();
    for (const auto& [name, value] : status.values) {
      room -= 4 + static_cast<int64_t>(name.size()) + 1 + 8;
      if (room < 0) break;
      message->value_names.push_back(Printable(name));
      message->values.push_back(value);
    }
    message->num_values = static_cast<int32_t>(message->values.size());
    emit(*message);
  }

  static std::string Join(const Message& message, StageStatus* status) {
    *status = {.name = message.name,
               .host = message.host,
               .version = message.version,
               .pid = message.pid,
               .epoch_us = message.stage_epoch_us,
               .state = static_cast<StageState>(message.state),
               .num_received = message.num_received,
               .num_published = message.num_published,
               .num_dropped = message.num_dropped,
               .num_repaired = message.num_repaired,
               .num_lost = message.num_lost,
               .num_undecodable = message.num_undecodable,
               .queue = message.queue,
               .step = GetStep(message),
               .cpu_percent = message.cpu_percent,
               .cpu_s = message.cpu_s,
               .rss_mb = message.rss_mb,
               .last_error = message.last_error,
               .values = {}};
    bool is_finite =
        std::isfinite(message.cpu_percent) && std::isfinite(message.cpu_s) && std::isfinite(message.rss_mb);
    for (size_t i = 0; i < std::min(static_cast<size_t>(message.num_values), kMaxValues); ++i) {
      is_finite = is_finite && std::isfinite(message.values[i]);
      status->values.emplace_back(message.value_names[i], message.values[i]);
    }
    return FirstProblem(
        {SentenceUnless(!message.name.empty(), "its name is empty"),
         SentenceUnless(message.state >= stage_status_t::STARTING && message.state <= stage_status_t::FAILED,
                        "its state is none"),
         CheckTimes(message.stage_epoch_us, 0), CheckCounts(message),
         SentenceUnless(is_finite && IsFinite(status->step), "one of its figures is not finite")});
  }

 private:
  static void SetStep(const StepStatistics& step, Message* message) {
    message->step_count = step.count;
    message->step_mean_ms = step.mean_ms;
    message->step_median_ms = step.median_ms;
    message->step_p95_ms = step.p95_ms;
    message->step_p99_ms = step.p99_ms;
    message->step_max_ms = step.max_ms;
  }
  static StepStatistics GetStep(const Message& message) {
    return {.count = message.step_count,
            .mean_ms = message.step_mean_ms,
            .median_ms = message.step_median_ms,
            .p95_ms = message.step_p95_ms,
            .p99_ms = message.step_p99_ms,
            .max_ms = message.step_max_ms};
  }
  static bool IsFinite(const StepStatistics& step) {
    return std::isfinite(step.mean_ms) && std::isfinite(step.median_ms) && std::isfinite(step.p95_ms) &&
           std::isfinite(step.p99_ms) && std::isfinite(step.max_ms);
  }
  static std::string CheckCounts(const Message& message) {
    const int64_t lowest =
        std::min({static_cast<int64_t>(message.pid), message.num_received, message.num_published, message.num_dropped,
                  message.num_repaired, message.num_lost, message.num_undecodable, message.queue, message.step_count});
    return SentenceUnless(lowest >= 0, "one of its counts is negative");
  }
};
TESSERA_CODEC(StageStatus);

}  // namespace tessera
