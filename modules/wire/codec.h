// Values to messages and back, one translation unit per group of values (codec_*.cc).
//
// Encoding never fails. Decoding believes nothing: a message is first walked over (wire_type.h), then every value in
// it is checked for its range; what makes no sense is refused with one sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "features/feature_types.h"
#include "geometry/camera_frame.h"
#include "map/map_exchange.h"
#include "map/removed_keyframes.h"
#include "messages/end_of_stream.h"
#include "messages/loop_types.h"
#include "messages/stage_messages.h"
#include "messages/stream_messages.h"
#include "messages/tracking_types.h"
#include "wire/bytes.h"
#include "wire/map_file.h"

namespace tessera {

// How a stream of these values is carried.
enum class Delivery {
  kFromFirst,  // in order, repaired; who comes late gets what the publisher still has
  kFromNow,    // in order, repaired; who comes late begins with what is sent from then on
  kUnordered,  // as it comes: each value says the whole state
};
template <class Value>
inline constexpr Delivery kDelivery = Delivery::kFromFirst;
// Jobs given to an extractor that died are given to others: its successor must not do them again.
template <>
inline constexpr Delivery kDelivery<TileJob> = Delivery::kFromNow;
// What a reassembler that was started again lacks is extracted again, which is less than all that extractors still
// have; one of a pool has answers to earlier runs, too.
template <>
inline constexpr Delivery kDelivery<TileFeatures> = Delivery::kFromNow;
// The map has a way of its own to catch up (MapFollower), which spares a late listener, and all others on the bus, the
// whole history.
template <>
inline constexpr Delivery kDelivery<MapDelta> = Delivery::kFromNow;
template <>
inline constexpr Delivery kDelivery<MapSnapshotPage> = Delivery::kFromNow;
template <>
inline constexpr Delivery kDelivery<MapRequest> = Delivery::kFromNow;
// Only one who waits asks, and asks again.
template <>
inline constexpr Delivery kDelivery<RelocalizationRequest> = Delivery::kFromNow;
template <>
inline constexpr Delivery kDelivery<ExtractorReady> = Delivery::kUnordered;
template <>
inline constexpr Delivery kDelivery<StageStatus> = Delivery::kUnordered;
template <>
inline constexpr Delivery kDelivery<Heartbeat> = Delivery::kUnordered;
template <>
inline constexpr Delivery kDelivery<RepairRequest> = Delivery::kUnordered;

// header_t, checked.
struct MessageHeader {
  std::string publisher;
  int64_t epoch_us = 0;
  int64_t sequence = 0;
  int64_t publish_us = 0;
  int32_t part = 0;
  int32_t num_parts = 1;
};

// The header of a message of any type; nullopt if the message has no type of lcmtypes/, is malformed or its header is
// out of range.
std::optional<MessageHeader> ReadHeader(ByteView message);

// The name of the type of the messages that carry `Value`, such as "camera_image_t".
template <class Value>
const char* TypeName();

// The messages that carry `value`, each of at most `max_bytes`. `first` is the header of the first one, whose part and
// num_parts are set here; the others follow it in sequence.
template <class Value>
std::vector<Bytes> EncodeValue(const Value& value, const MessageHeader& first, size_t max_bytes);

// When the value happened by the source's clock, us, if it is what sets the pace of a recorded log: a frame.
template <class Value>
std::optional<int64_t> SourceTime(const Value& value) {
  if constexpr (std::is_same_v<Value, CameraFrame>) {
    return value.utime_us;
  } else {
    return std::nullopt;
  }
}

// Puts the parts of one value after another together.
template <class Value>
class ValueJoiner {
 public:
  ValueJoiner();
  ~ValueJoiner();

  enum class Result {
    kIncomplete,  // more parts are needed (or this one belongs to a value whose beginning was missed)
    kComplete,    // value() is there
    kRefused,     // problem() says why; the rest of the value is passed over
  };
  // The next message of the stream, for which ReadHeader gave `header`.
  Result Add(ByteView message, const MessageHeader& header);
  // Messages got lost before the next one. True if the value that was being joined is lost with them.
  bool Interrupt();

  const Value& value() const;
  const std::string& problem() const { return problem_; }

 private:
  struct State;
  std::unique_ptr<State> state_;
  std::string problem_;
};

}  // namespace tessera
