// The typed side of a stage's engine: values to messages and back.
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "core/errors.h"
#include "runtime/stage_engine.h"
#include "wire/codec.h"
#include "wire/value_types.h"

namespace tessera {
namespace {

constexpr size_t kMaxPublishers = 4096;  // of one channel

}  // namespace

template <class Value>
void StageContext::Impl::Send(int stream, const Value& value) {
  if (stopped_ && stream != status_stream_) return;
  const MessageHeader header = outgoing_.NextHeader(stream, clock_->WallUs());
  bool is_sent = false;
  try {
    is_sent = outgoing_.Send(stream, EncodeValue(value, header, outgoing_.MaxMessageBytes(stream)), SourceTime(value));
  } catch (const InputError& error) {
    return Fail(error.what(), 2);  // the log that is written can't be kept
  }
  if (!is_sent) ReportError("the operating system refused to send a message on " + outgoing_.channel(stream));
  if (kDelivery<Value> == Delivery::kUnordered) return;
  ++figures_.num_published;
  soon_due_us_ = clock_->NowUs() + stream_settings_.receiver.repair_us;
}

template <class Value>
void StageContext::Impl::Subscribe(const Channel& channel,
                                   std::function<void(const Value&, const MessageHeader&, int64_t)> handler) {
  struct Joining {
    ValueJoiner<Value> joiner;
    int64_t arrival_us = 0;  // of the value's first part
  };
  auto joinings = std::make_shared<std::map<std::string, Joining>>();  // by publisher
  ChannelReceiver::Sink sink;
  sink.deliver = [this, joinings, name = channel.name, handler = std::move(handler)](
                     ByteView message, const MessageHeader& header, int64_t arrival_us) {
    if (joinings->size() > kMaxPublishers) joinings->clear();  // made-up names
    Joining& joining = (*joinings)[header.publisher];
    if (header.part == 0) joining.arrival_us = arrival_us;
    switch (joining.joiner.Add(message, header)) {
      case ValueJoiner<Value>::Result::kIncomplete:
        return;
      case ValueJoiner<Value>::Result::kRefused:
        return incoming_.Refuse(name, joining.joiner.problem());
      case ValueJoiner<Value>::Result::kComplete:
        if (kDelivery<Value> != Delivery::kUnordered) ++figures_.num_received;
        CallSafely("a value on " + name, [&] { handler(joining.joiner.value(), header, joining.arrival_us); });
    }
  };
  sink.lose = [this, joinings, name = channel.name](const std::string& publisher, int64_t num_messages) {
    (*joinings)[publisher].joiner.Interrupt();
    if (num_messages > 0) {
      ReportError(std::to_string(num_messages) + " messages of " + publisher + " on " + name +
                  " are lost: they were asked for again and did not come");
    }
  };
  incoming_.Add(channel, TypeName<Value>(), BusOf(channel), kDelivery<Value>, std::move(sink));
}

#define TESSERA_ENGINE(Value)                                       \
  template void StageContext::Impl::Send<Value>(int, const Value&); \
  template void StageContext::Impl::Subscribe<Value>(               \
      const Channel&, std::function<void(const Value&, const MessageHeader&, int64_t)>);
TESSERA_FOR_EACH_VALUE_TYPE(TESSERA_ENGINE)
TESSERA_ENGINE(Heartbeat)
TESSERA_ENGINE(RepairRequest)
#undef TESSERA_ENGINE

}  // namespace tessera
