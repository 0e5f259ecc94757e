#include "runtime/outgoing_streams.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kStreamsPerHeartbeat = 16;  // fits 1400 bytes
constexpr int kMaxResent = 1024;             // messages sent again on one request
constexpr size_t kLcmHeaderBytes = 8;
constexpr double kResentBytesPerSecond = 64e6;  // in all: all that is kept of a stream within a second or so

// A message of several packets of which one is lost leaves the others in its receiver's kernel: for 30 s of the 4 MB
// that are there for the packets of all messages (net.ipv4.ipfrag_time, ipfrag_high_thresh). Once these are full,
// nothing of several packets arrives any more. So while more than some get lost, messages have one packet.
constexpr double kToleratedLossesPerSecond = 2;
constexpr double kToleratedLossesAtOnce = 20;
constexpr int64_t kSmallUs = 10'000'000;

}  // namespace

OutgoingStreams::OutgoingStreams(const StageIdentity& identity, const StreamSettings& settings)
    : identity_(identity),
      settings_(settings),
      resending_(kResentBytesPerSecond, 0.5 * static_cast<double>(settings.receive_buffer_bytes)),
      tolerated_losses_(kToleratedLossesPerSecond, kToleratedLossesAtOnce) {}

int OutgoingStreams::Add(const Channel& channel, std::shared_ptr<Bus> bus, bool is_repaired) {
  const bool is_continued = continued_.contains(channel.name);
  streams_.push_back({.channel = channel,
                      .full_name = settings_.channel_prefix + channel.name,
                      .bus = std::move(bus),
                      .epoch_us = is_continued ? continued_epoch_us_ : identity_.epoch_us,
                      .is_continued = is_continued,
                      .is_repaired = is_repaired,
                      .history = StreamHistory(settings_.history_bytes)});
  return static_cast<int>(streams_.size()) - 1;
}

void OutgoingStreams::BeginReplay(const std::set<std::string>& channels, int64_t epoch_us) {
  continued_ = channels;
  continued_epoch_us_ = epoch_us;
  is_replaying_ = true;
}

MessageHeader OutgoingStreams::NextHeader(int stream, int64_t wall_us) const {
  return {.publisher = identity_.name,
          .epoch_us = streams_[static_cast<size_t>(stream)].epoch_us,
          .sequence = streams_[static_cast<size_t>(stream)].num_sent,
          .publish_us = wall_us};
}

size_t OutgoingStreams::MaxMessageBytes(int stream, int64_t now_us) const {
  const Stream& sent = streams_[static_cast<size_t>(stream)];
  const bool is_work = sent.channel.bus == BusKind::kWork || sent.channel.bus == BusKind::kTile;
  // Others may be continued in a later life, whose messages have to be cut alike.
  const bool is_small = is_work && now_us < small_until_us_;
  const size_t datagram_bytes = is_small ? std::min(settings_.max_message_bytes, settings_.max_work_message_bytes)
                                         : settings_.MaxMessageBytes(sent.channel.bus);
  return datagram_bytes - kLcmHeaderBytes - sent.full_name.size() - 1;
}

bool OutgoingStreams::Send(int stream_number, std::vector<Bytes> messages, std::optional<int64_t> source_us) {
  Stream& stream = streams_[static_cast<size_t>(stream_number)];
  const bool is_kept = stream.is_repaired && stream.bus->can_listen();
  const bool is_made_again = is_replaying_ && stream.channel.delivery != Delivery::kUnordered;
  if (is_made_again && !stream.is_continued) return true;
  bool all_sent = true;
  for (Bytes& message : messages) {
    ++stream.num_sent;
    if (settings_.authenticator) settings_.authenticator->Sign(stream.full_name, &message);
    const Bytes& kept = is_kept ? stream.history.Append(std::move(message)) : message;
    if (!is_made_again) all_sent = stream.bus->Publish(stream.full_name, kept, source_us) && all_sent;
  }
  return all_sent;
}

void OutgoingStreams::Resend(const RepairRequest& request, int64_t now_us) {
  if (request.publisher != identity_.name) {
    return;
  }
  const auto stream = std::find_if(streams_.begin(), streams_.end(), [&](const Stream& candidate) {
    return candidate.channel.name == request.channel && candidate.epoch_us == request.epoch_us;
  });
  if (stream == streams_.end()) {
    return;
  }
  int num_resent = 0;
  for (const SequenceRange& range : request.ranges) {
    const int64_t end = std::min(range.last + 1, stream->history.next());
    for (int64_t i = std::max(range.first, stream->history.first()); i < end && num_resent < kMaxResent; ++i) {
      if (const Bytes* message = stream->history.Resend(i, now_us, settings_.receiver.repair_us / 2)) {
        if (!resending_.Take(static_cast<double>(message->size()), now_us)) return;
        stream->bus->Publish(stream->full_name, *message, std::nullopt);
        ++num_resent;
        if (!tolerated_losses_.Take(1, now_us)) small_until_us_ = now_us + kSmallUs;
      }
    }
  }
}

std::vector<Heartbeat> OutgoingStreams::MakeHeartbeats() const {
  std::vector<Heartbeat> heartbeats(1);
  for (const Stream& stream : streams_) {
    if (!stream.is_repaired) continue;
    if (heartbeats.back().streams.size() == kStreamsPerHeartbeat) heartbeats.emplace_back();
    heartbeats.back().streams.push_back({.channel = stream.channel.name,
                                         .epoch_us = stream.epoch_us,
                                         .first_sequence = stream.history.first(),
                                         .next_sequence = stream.history.next(),
                                         .is_exclusive = stream.channel.publishers == Publishers::kOne});
  }
  for (Heartbeat& heartbeat : heartbeats) {
    heartbeat.host = identity_.host;
    heartbeat.pid = identity_.pid;
  }
  return heartbeats;
}

bool OutgoingStreams::IsExclusive(const std::string& channel) const {
  return std::any_of(streams_.begin(), streams_.end(), [&](const Stream& stream) {
    return stream.channel.publishers == Publishers::kOne && stream.channel.name == channel;
  });
}

}  // namespace tessera
