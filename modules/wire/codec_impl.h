// What every codec has in common. A codec_*.cc file defines, for each of its values,
//
//   template <> struct Codec<Value> {
//     using Message = ...;                       // generated type
//     static constexpr const char* kTypeName;
//     // Calls emit(message) for each part; no message may get larger than max_bytes. The header is set by the caller.
//     template <class Emit> static void Cut(const Value& value, Message* message, size_t max_bytes, Emit emit);
//     // Takes one part in; the first sets *value anew. Empty, or what is wrong with it.
//     static std::string Join(const Message& message, Value* value);
//   };
//
// and then says TESSERA_CODEC(Value).
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tessera/header_t.hpp"
#include "wire/codec.h"
#include "wire/wire_type.h"

namespace tessera {

template <class Value>
struct Codec;

void SetHeader(const MessageHeader& header, header_t* message_header);
// Writes num_parts into an encoded message whose header has this publisher.
void PatchNumParts(const std::string& publisher, int32_t num_parts, Bytes* message);
// Texts on the wire have no control characters.
std::string Printable(const std::string& text);

template <class Message>
Bytes EncodeMessage(const Message& message) {
  const int size = message.getEncodedSize();
  Bytes bytes(static_cast<size_t>(size));
  if (message.encode(bytes.data(), 0, size) != size) {
    throw std::logic_error(std::string(Message::getTypeName()) + " could not be encoded");
  }
  return bytes;
}

// False if `bytes`, which must have passed WireType::Matches, can't be decoded after all.
template <class Message>
bool DecodeMessage(ByteView bytes, Message* message) {
  return message->decode(bytes.data(), 0, static_cast<int>(bytes.size())) >= 0;
}

template <class Value>
const char* TypeName() {
  return Codec<Value>::kTypeName;
}

template <class Value>
std::vector<Bytes> EncodeValue(const Value& value, const MessageHeader& first, size_t max_bytes) {
  std::vector<Bytes> parts;
  MessageHeader header = first;
  header.part = 0;
  typename Codec<Value>::Message message{};
  SetHeader(header, &message.header);
  Codec<Value>::Cut(value, &message, max_bytes, [&](const typename Codec<Value>::Message& part) {
    parts.push_back(EncodeMessage(part));
    ++header.part;
    ++header.sequence;
    SetHeader(header, &message.header);
  });
  if (parts.size() > 1) {
    for (Bytes& part : parts) {
      PatchNumParts(first.publisher, static_cast<int32_t>(parts.size()), &part);
    }
  }
  return parts;
}

template <class Value>
struct ValueJoiner<Value>::State {
  Value value;
  typename Codec<Value>::Message message{};
  int32_t next_part = 0;  // 0: a value may begin
  int32_t num_parts = 0;  // of the value that has begun
};

template <class Value>
ValueJoiner<Value>::ValueJoiner() : state_(std::make_unique<State>()) {}

template <class Value>
ValueJoiner<Value>::~ValueJoiner() = default;

template <class Value>
bool ValueJoiner<Value>::Interrupt() {
  const bool had_begun = state_->next_part > 0;
  state_->next_part = 0;
  return had_begun;
}

template <class Value>
Result<const Value*> ValueJoiner<Value>::Add(ByteView message, const MessageHeader& header) {
  State& state = *state_;
  const int32_t expected_part = std::exchange(state.next_part, 0);
  const bool continues = header.part == expected_part && (header.part == 0 || header.num_parts == state.num_parts);
  if (!continues && header.part > 0) return nullptr;
  static const WireType& type = WireType::Named(Codec<Value>::kTypeName);
  if (WireType::Of(message) != &type || !DecodeMessage(message, &state.message)) {
    return Failed("it is not a " + type.name());
  }
  if (const std::string problem = Codec<Value>::Join(state.message, &state.value); !problem.empty()) {
    return Failed(problem);
  }
  if (header.part + 1 == header.num_parts) return &state.value;
  state.next_part = header.part + 1;
  state.num_parts = header.num_parts;
  return nullptr;
}

template <class Value>
std::optional<int64_t> SourceTime(const Value& value) {
  if constexpr (requires { Codec<Value>::SourceTime(value); }) {
    return Codec<Value>::SourceTime(value);
  } else {
    return std::nullopt;
  }
}

#define TESSERA_CODEC(Value)                                                                  \
  template const char* TypeName<Value>();                                                     \
  template std::optional<int64_t> SourceTime<Value>(const Value&);                            \
  template std::vector<Bytes> EncodeValue<Value>(const Value&, const MessageHeader&, size_t); \
  template class ValueJoiner<Value>

}  // namespace tessera
