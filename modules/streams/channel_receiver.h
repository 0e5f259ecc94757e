// A subscriber's end of one channel: the streams of all its publishers. A publisher that was started again (a new
// epoch under the same name) begins a new stream, which replaces the old one.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "streams/stream_receiver.h"

namespace tessera {

class ChannelReceiver {
 public:
  struct Sink {
    std::function<void(ByteView message, const MessageHeader& header, int64_t arrival_us)> deliver;
    // Before what comes next from this publisher, so many messages are missing (0: it was started again).
    std::function<void(const std::string& publisher, int64_t num_messages)> lose;
  };
  // `channel`: name without prefix.
  ChannelReceiver(std::string channel, const StreamReceiverOptions& options, Sink sink);

  // False if the header makes no sense in its stream, or there are far too many publishers.
  bool OnMessage(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us);
  void OnHeartbeat(const std::string& publisher, const StreamHead& head, int64_t now_us);

  // A message that was delivered in an earlier life, in the order of that time. What comes next continues behind it.
  void Replay(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us);
  // The messages of its stream up to this one were taken in an earlier life.
  void ContinueBehind(const MessageHeader& header, int64_t now_us);

  // As in StreamReceiver, over all streams.
  std::vector<RepairRequest> Poll(int64_t now_us);
  std::optional<int64_t> next_poll_us() const;

  // All streams are over: delivers what has arrived and counts what is missing.
  void Abandon();

  const std::string& channel() const { return channel_; }
  StreamCounts counts() const;

 private:
  struct Stream {
    int64_t epoch_us = 0;
    std::unique_ptr<StreamReceiver> receiver;
  };
  StreamReceiver* Find(const std::string& publisher, int64_t epoch_us);

  std::string channel_;
  StreamReceiverOptions options_;
  Sink sink_;
  std::map<std::string, Stream> streams_;  // by publisher
  StreamCounts past_counts_;               // of streams that were replaced
};

}  // namespace tessera
