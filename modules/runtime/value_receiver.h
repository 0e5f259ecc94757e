// The typed end of a subscription: joins the messages of a stream to values and hands them to a stage's handler.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "core/result.h"
#include "messages/end_of_stream.h"
#include "wire/codec.h"

namespace tessera {

struct MessageInfo {
  std::string publisher;   // stage name
  int64_t epoch_us = 0;    // start time of the publisher
  int64_t sequence = 0;    // of the value's last part in its stream
  int64_t publish_us = 0;  // publisher's wall clock when it sent it; for measuring only
  int64_t arrival_us = 0;  // wall clock at which the first part arrived here; for measuring only
};

// A failed result refuses the value: it is counted, reported and passed over.
template <class Value>
using ValueHandler = std::function<Result<>(Value&&, const MessageInfo&)>;

// The handler of a stage, which takes the value alone or with its info, and returns nothing or a Result<>. One that
// keeps the value takes it as a Value, which costs no copy.
template <class Value, class Handler>
ValueHandler<Value> MakeValueHandler(Handler handler) {
  return [handler = std::move(handler)](Value&& value, const MessageInfo& info) mutable -> Result<> {
    const auto call = [&] {
      if constexpr (std::is_invocable_v<Handler&, Value&&, const MessageInfo&>) {
        return handler(std::move(value), info);
      } else {
        return handler(std::move(value));
      }
    };
    if constexpr (std::is_void_v<decltype(call())>) {
      call();
      return {};
    } else {
      return call();
    }
  };
}

// One publisher's stream on a subscribed channel, without the type of its values.
class ValueReceiver {
 public:
  virtual ~ValueReceiver() = default;
  // Takes the next message. True if it completed a value, which the handler has accepted; fails if the message is
  // malformed or the handler refused the value.
  virtual Result<bool> Receive(ByteView message, const MessageHeader& header, int64_t arrival_us) = 0;
  // Messages are missing before the next one.
  virtual void Interrupt() = 0;
};
using MakeReceiver = std::function<std::unique_ptr<ValueReceiver>()>;

template <class Value>
class TypedReceiver : public ValueReceiver {
 public:
  explicit TypedReceiver(std::shared_ptr<const ValueHandler<Value>> handler) : handler_(std::move(handler)) {}

  Result<bool> Receive(ByteView message, const MessageHeader& header, int64_t arrival_us) override {
    if (header.part == 0) arrival_us_ = arrival_us;
    const Result<Value*> value = joiner_.Add(message, header);
    TESSERA_RETURN_IF_FAILED(value);
    if (*value == nullptr) return false;
    if constexpr (std::is_same_v<Value, EndOfStream>) {
      if (header.is_from_outside && (*value)->stage != StageKind::kCamera) {
        return Failed("only the end of the camera's stream may come from outside of the run");
      }
    }
    TESSERA_RETURN_IF_FAILED((*handler_)(std::move(**value), {.publisher = header.publisher,
                                                              .epoch_us = header.epoch_us,
                                                              .sequence = header.sequence,
                                                              .publish_us = header.publish_us,
                                                              .arrival_us = arrival_us_}));
    return true;
  }
  void Interrupt() override { joiner_.Interrupt(); }

 private:
  std::shared_ptr<const ValueHandler<Value>> handler_;
  ValueJoiner<Value> joiner_;
  int64_t arrival_us_ = 0;  // of the value's first part
};

template <class Value, class Handler>
MakeReceiver MakeReceiverOf(Handler handler) {
  auto shared = std::make_shared<const ValueHandler<Value>>(MakeValueHandler<Value>(std::move(handler)));
  return [shared = std::move(shared)] { return std::make_unique<TypedReceiver<Value>>(shared); };
}

}  // namespace tessera
