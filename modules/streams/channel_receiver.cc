#include "streams/channel_receiver.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kMaxPublishers = 2048;  // of one channel; names beyond that are forged

}  // namespace

ChannelReceiver::ChannelReceiver(std::string channel, const StreamReceiverOptions& options, Sink sink)
    : channel_(std::move(channel)), options_(options), sink_(std::move(sink)) {}

// The stream; a new one takes the place of an older epoch's. Null for an epoch that is over.
StreamReceiver* ChannelReceiver::Find(const std::string& publisher, int64_t epoch_us) {
  const auto it = streams_.find(publisher);
  if (it != streams_.end() && it->second.epoch_us == epoch_us) {
    return it->second.receiver.get();
  }
  if (it != streams_.end() ? it->second.epoch_us > epoch_us : streams_.size() >= kMaxPublishers) {
    return nullptr;
  }
  if (it != streams_.end()) {
    if (!options_.discards_at_restart) it->second.receiver->Abandon();
    past_counts_.num_repaired += it->second.receiver->counts().num_repaired;
    past_counts_.num_lost += it->second.receiver->counts().num_lost;
    sink_.lose(publisher, 0);
  }
  Stream& stream = streams_[publisher];
  stream.epoch_us = epoch_us;
  stream.receiver = std::make_unique<StreamReceiver>(
      options_, StreamReceiver::Sink{.deliver = sink_.deliver, .lose = [this, publisher](int64_t num_messages) {
                                       sink_.lose(publisher, num_messages);
                                     }});
  return stream.receiver.get();
}

bool ChannelReceiver::OnMessage(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us) {
  StreamReceiver* receiver = Find(header.publisher, header.epoch_us);
  if (receiver == nullptr) {
    return streams_.contains(header.publisher);  // a late message of an earlier epoch is no error
  }
  return receiver->OnMessage(header, message, arrival_us, now_us);
}

void ChannelReceiver::OnHeartbeat(const std::string& publisher, const StreamHead& head, int64_t now_us) {
  if (StreamReceiver* receiver = Find(publisher, head.epoch_us)) {
    receiver->OnHeartbeat(head.first_sequence, head.next_sequence, now_us);
  }
}

void ChannelReceiver::Replay(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us) {
  if (StreamReceiver* receiver = Find(header.publisher, header.epoch_us)) {
    receiver->Replay(header, message, arrival_us, now_us);
  }
}

void ChannelReceiver::ContinueBehind(const MessageHeader& header, int64_t now_us) {
  if (StreamReceiver* receiver = Find(header.publisher, header.epoch_us)) receiver->ContinueBehind(header, now_us);
}

std::vector<RepairRequest> ChannelReceiver::Poll(int64_t now_us) {
  std::vector<RepairRequest> requests;
  for (auto& [publisher, stream] : streams_) {
    std::vector<SequenceRange> ranges = stream.receiver->Poll(now_us);
    if (!ranges.empty()) {
      requests.push_back(
          {.channel = channel_, .publisher = publisher, .epoch_us = stream.epoch_us, .ranges = std::move(ranges)});
    }
  }
  return requests;
}

std::optional<int64_t> ChannelReceiver::next_poll_us() const {
  std::optional<int64_t> next;
  for (const auto& [publisher, stream] : streams_) {
    const auto poll_us = stream.receiver->next_poll_us();
    if (poll_us && (!next || *poll_us < *next)) next = poll_us;
  }
  return next;
}

void ChannelReceiver::Abandon() {
  for (auto& [publisher, stream] : streams_) stream.receiver->Abandon();
}

StreamCounts ChannelReceiver::counts() const {
  StreamCounts counts = past_counts_;
  for (const auto& [publisher, stream] : streams_) {
    counts.num_repaired += stream.receiver->counts().num_repaired;
    counts.num_lost += stream.receiver->counts().num_lost;
  }
  return counts;
}

}  // namespace tessera
