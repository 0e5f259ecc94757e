// STATUS, HEARTBEAT, REPAIR.
#include <string>
#include <utility>

#include "messages/stage_messages.h"
#include "messages/stream_messages.h"
#include "tessera/heartbeat_t.hpp"
#include "tessera/repair_request_t.hpp"
#include "tessera/stage_status_t.hpp"
#include "wire/codec_impl.h"

namespace tessera {
namespace {

constexpr int64_t kMaxSequence = int64_t{1} << 53;

}  // namespace

template <>
inline constexpr StageState kLastEnumerator<StageState> = StageState::kFailed;

template <>
struct Layout<stage_status_t> {
  // A status is read alone, also by tools that join no parts: figures that find no room are left out.
  static constexpr bool kIsOnePart = true;

  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& status) {
    fields(message.name, status.name);
    fields(message.host, status.host);
    fields(message.version, status.version);
    fields.Count(message.pid, status.pid);
    fields.Time(message.stage_epoch_us, status.epoch_us);
    fields(message.state, status.state);
    fields.Count(message.num_received, status.num_received);
    fields.Count(message.num_published, status.num_published);
    fields.Count(message.num_dropped, status.num_dropped);
    fields.Count(message.num_repaired, status.num_repaired);
    fields.Count(message.num_lost, status.num_lost);
    fields.Count(message.num_undecodable, status.num_undecodable);
    fields.Count(message.num_strangers, status.num_strangers);
    fields.Count(message.queue, status.queue);
    fields.Count(message.step_count, status.step.count);
    fields(message.step_mean_ms, status.step.mean_ms);
    fields(message.step_median_ms, status.step.median_ms);
    fields(message.step_p95_ms, status.step.p95_ms);
    fields(message.step_p99_ms, status.step.p99_ms);
    fields(message.step_max_ms, status.step.max_ms);
    fields(message.cpu_percent, status.cpu_percent);
    fields(message.cpu_s, status.cpu_s);
    fields(message.rss_mb, status.rss_mb);
    fields(message.last_error, status.last_error);
    fields.Check(!status.name.empty(), "its name is empty");
    using Figure = std::pair<std::string, double>;
    fields.Table(message.num_values, AnyRow, Column(message.value_names, status.values, &Figure::first),
                 Column(message.values, status.values, &Figure::second));
  }
};
TESSERA_CODEC(StageStatus, stage_status_t);

template <>
struct Layout<stream_head_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& head) {
    fields(message.channel, head.channel);
    fields.Time(message.epoch_us, head.epoch_us);
    fields.Count(message.first_sequence, head.first_sequence);
    fields.Count(message.next_sequence, head.next_sequence);
    fields(message.is_exclusive, head.is_exclusive);
    fields.Check(head.first_sequence <= head.next_sequence && head.next_sequence <= kMaxSequence,
                 "a stream's numbers are out of range");
  }
};

template <>
struct Layout<heartbeat_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& heartbeat) {
    fields(message.host, heartbeat.host);
    fields.Count(message.pid, heartbeat.pid);
    fields.List(message.num_streams, message.streams, heartbeat.streams);
  }
};
TESSERA_CODEC(Heartbeat, heartbeat_t);

template <>
struct Layout<repair_request_t> {
  template <class Fields, class Message, class Value>
  static void Describe(Fields& fields, Message& message, Value& request) {
    fields(message.channel, request.channel);
    fields(message.stream_publisher, request.publisher);
    fields.Time(message.stream_epoch_us, request.epoch_us);
    auto& ranges = request.ranges;
    fields.Table(
        message.num_ranges,
        [&](size_t i) {
          return ranges[i].first >= 0 && ranges[i].first <= ranges[i].last && ranges[i].last <= kMaxSequence;
        },
        Column(message.first_sequence, ranges, &SequenceRange::first),
        Column(message.last_sequence, ranges, &SequenceRange::last));
  }
};
TESSERA_CODEC(RepairRequest, repair_request_t);

}  // namespace tessera
