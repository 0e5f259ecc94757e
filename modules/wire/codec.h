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
#include <vector>

#include "core/result.h"
#include "wire/bytes.h"

namespace tessera {

// Where header_t::tag stands in every message: behind the type's fingerprint.
inline constexpr size_t kTagOffset = 8;
inline constexpr size_t kTagBytes = 16;

// header_t, checked, without its tag.
struct MessageHeader {
  std::string publisher;
  int64_t epoch_us = 0;
  int64_t sequence = 0;
  int64_t publish_us = 0;
  int32_t part = 0;
  int32_t num_parts = 1;
  bool is_from_outside = false;  // no field: it was accepted although its sender is no member of the run
};

// The header of a message of any type; nullopt if the message has no type of lcmtypes/, is malformed or its header is
// out of range.
std::optional<MessageHeader> ReadHeader(ByteView message);
// The same of a message of ours that is not whole, or not looked at behind its header.
std::optional<MessageHeader> ReadHeaderOfFront(ByteView message);

// The name of the type of the messages that carry `Value`, such as "camera_image_t".
template <class Value>
const char* TypeName();

// The messages that carry `value`, each of at most `max_bytes`. `first` is the header of the first one, whose part and
// num_parts are set here; the others follow it in sequence.
template <class Value>
std::vector<Bytes> EncodeValue(const Value& value, const MessageHeader& first, size_t max_bytes);

// When the value happened by the source's clock, us, if it is what sets the pace of a recorded log: a frame.
template <class Value>
std::optional<int64_t> SourceTime(const Value& value);

// Puts the parts of one value after another together.
template <class Value>
class ValueJoiner {
 public:
  ValueJoiner();
  ~ValueJoiner();

  // Takes the next message of the stream, for which ReadHeader gave `header`. The value, which stays valid until the
  // next call and may be moved from; null if more parts are needed, or if this one belongs to a value whose beginning
  // was missed. On failure the rest of the value is passed over.
  Result<Value*> Add(ByteView message, const MessageHeader& header);
  // Messages got lost before the next one. True if the value that was being joined is lost with them.
  bool Interrupt();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
