// HEARTBEAT, REPAIR.
#include "messages/stream_messages.h"
#include "tessera/heartbeat_t.hpp"
#include "tessera/repair_request_t.hpp"
#include "wire/codec_impl.h"
#include "wire/codec_parts.h"

namespace tessera {
namespace {

constexpr int64_t kMaxSequence = int64_t{1} << 53;

}  // namespace

template <>
struct Codec<Heartbeat> {
  using Message = heartbeat_t;
  static constexpr const char* kTypeName = "heartbeat_t";

  template <class Emit>
  static void Cut(const Heartbeat& heartbeat, Message* message, size_t, Emit emit) {
    message->host = Printable(heartbeat.host);
    message->pid = heartbeat.pid;
    message->num_streams = static_cast<int32_t>(heartbeat.streams.size());
    for (const StreamHead& head : heartbeat.streams) {
      stream_head_t& stream = message->streams.emplace_back();
      stream.channel = head.channel;
      stream.first_sequence = head.first_sequence;
      stream.next_sequence = head.next_sequence;
      stream.is_exclusive = head.is_exclusive ? 1 : 0;
    }
    emit(*message);
  }

  static std::string Join(const Message& message, Heartbeat* heartbeat) {
    *heartbeat = {.host = message.host, .pid = message.pid, .streams = {}};
    for (const stream_head_t& stream : message.streams) {
      if (stream.first_sequence < 0 || stream.first_sequence > stream.next_sequence ||
          stream.next_sequence > kMaxSequence) {
        return "a stream's numbers are out of range";
      }
      heartbeat->streams.push_back({.channel = stream.channel,
                                    .first_sequence = stream.first_sequence,
                                    .next_sequence = stream.next_sequence,
                                    .is_exclusive = stream.is_exclusive != 0});
    }
    return SentenceUnless(message.pid >= 0, "its process id is negative");
  }
};
TESSERA_CODEC(Heartbeat);

template <>
struct Codec<RepairRequest> {
  using Message = repair_request_t;
  static constexpr const char* kTypeName = "repair_request_t";

  template <class Emit>
  static void Cut(const RepairRequest& request, Message* message, size_t, Emit emit) {
    message->channel = request.channel;
    message->stream_publisher = request.publisher;
    message->stream_epoch_us = request.epoch_us;
    message->num_ranges = static_cast<int32_t>(request.ranges.size());
    for (const SequenceRange& range : request.ranges) {
      message->first_sequence.push_back(range.first);
      message->last_sequence.push_back(range.last);
    }
    emit(*message);
  }

  static std::string Join(const Message& message, RepairRequest* request) {
    *request = {.channel = message.channel,
                .publisher = message.stream_publisher,
                .epoch_us = message.stream_epoch_us,
                .ranges = {}};
    for (size_t i = 0; i < static_cast<size_t>(message.num_ranges); ++i) {
      const SequenceRange range{message.first_sequence[i], message.last_sequence[i]};
      if (range.first < 0 || range.first > range.last || range.last > kMaxSequence) {
        return "a range of numbers is out of order";
      }
      request->ranges.push_back(range);
    }
    return CheckTimes(request->epoch_us, 0);
  }
};
TESSERA_CODEC(RepairRequest);

}  // namespace tessera
