// Encodes and decodes values by the layouts of their messages. A codec_*.cc file defines the layouts (layout.h) and
// then says, for each value, TESSERA_CODEC(Value, message_t).
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tessera/header_t.hpp"
#include "wire/codec.h"
#include "wire/layout.h"
#include "wire/part_reader.h"
#include "wire/part_writer.h"
#include "wire/wire_type.h"

namespace tessera {

// The type of the messages that carry a value.
template <class Value>
struct Carrier;
template <class Value>
using MessageOf = typename Carrier<Value>::Message;

void SetHeader(const MessageHeader& header, header_t* message_header);
// Writes num_parts into an encoded message whose header has this publisher.
void PatchNumParts(const std::string& publisher, int32_t num_parts, Bytes* message);

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
  return MessageOf<Value>::getTypeName();
}

// A layout that says kIsOnePart has values of which only what fits into one message is sent.
template <class Message>
constexpr bool IsOnePart() {
  return requires { Layout<Message>::kIsOnePart; };
}

template <class Value>
std::vector<Bytes> EncodeValue(const Value& value, const MessageHeader& first, size_t max_bytes) {
  using Message = MessageOf<Value>;
  std::vector<Bytes> parts;
  MessageHeader header = first;
  header.part = 0;
  Message message{};
  SetHeader(header, &message.header);
  PartWriter writer;
  writer.BeginEmptyPart();
  Layout<Message>::Describe(writer, message, value);
  const auto overhead = static_cast<size_t>(message.getEncodedSize());
  do {
    writer.BeginPart(max_bytes - std::min(max_bytes, overhead));
    Layout<Message>::Describe(writer, message, value);
    parts.push_back(EncodeMessage(message));
    ++header.part;
    ++header.sequence;
    SetHeader(header, &message.header);
  } while (!writer.done() && !IsOnePart<Message>());
  if (parts.size() > 1) {
    for (Bytes& part : parts) PatchNumParts(first.publisher, static_cast<int32_t>(parts.size()), &part);
  }
  return parts;
}

template <class Value>
std::optional<int64_t> SourceTime(const Value& value) {
  if constexpr (requires { Layout<MessageOf<Value>>::SourceTime(value); }) {
    return Layout<MessageOf<Value>>::SourceTime(value);
  } else {
    return std::nullopt;
  }
}

template <class Value>
struct ValueJoiner<Value>::State {
  Value value;
  MessageOf<Value> message{};
  PartReader reader;
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
Result<Value*> ValueJoiner<Value>::Add(ByteView message, const MessageHeader& header) {
  using Message = MessageOf<Value>;
  State& state = *state_;
  const int32_t expected_part = std::exchange(state.next_part, 0);
  const bool continues = header.part == expected_part && (header.part == 0 || header.num_parts == state.num_parts);
  if (!continues && header.part > 0) return nullptr;
  static const WireType& type = WireType::Named(TypeName<Value>());
  if (WireType::Of(message) != &type || !DecodeMessage(message, &state.message)) {
    return Failed("it is not a " + type.name());
  }
  const bool is_last = header.part + 1 == header.num_parts;
  if (header.part == 0) state.value = {};
  state.reader.BeginPart(header.part == 0, is_last);
  Layout<Message>::Describe(state.reader, std::as_const(state.message), state.value);
  TESSERA_RETURN_IF_FAILED(state.reader.EndPart());
  if (is_last) return &state.value;
  state.next_part = header.part + 1;
  state.num_parts = header.num_parts;
  return nullptr;
}

#define TESSERA_CODEC(Value, message_t)                                                       \
  template <>                                                                                 \
  struct Carrier<Value> {                                                                     \
    using Message = message_t;                                                                \
  };                                                                                          \
  template const char* TypeName<Value>();                                                     \
  template std::optional<int64_t> SourceTime<Value>(const Value&);                            \
  template std::vector<Bytes> EncodeValue<Value>(const Value&, const MessageHeader&, size_t); \
  template class ValueJoiner<Value>

}  // namespace tessera
