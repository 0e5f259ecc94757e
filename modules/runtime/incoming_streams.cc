#include "runtime/incoming_streams.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

constexpr size_t kMaxRawChannels = 4096;  // that are put in order while recording

bool IsOneOf(const WireType* type, std::initializer_list<const char*> names) {
  return type != nullptr &&
         std::any_of(names.begin(), names.end(), [&](const char* name) { return type->name() == name; });
}

bool HasNoOrder(const WireType* type) { return IsOneOf(type, {"extractor_ready_t", "stage_status_t"}); }

// What a camera, or a log player in its place, sends.
bool IsSentByCameras(const std::string& channel) {
  return channel == kCamera.name || channel == kColor.name || channel == kCalibration.name ||
         channel == kGroundTruth.name || channel == kEndOfStream.name;
}

}  // namespace

IncomingStreams::IncomingStreams(const StreamSettings& settings, const Clock& clock,
                                 std::function<void(const std::string&)> report)
    : settings_(settings), clock_(clock), report_(std::move(report)) {}

IncomingStreams::~IncomingStreams() { Close(); }

void IncomingStreams::Close() {
  for (const auto& bus : buses_) bus->Unsubscribe(this);
}

void IncomingStreams::Add(const Channel& channel, const char* type, std::shared_ptr<Bus> bus,
                          ChannelReceiver::Sink sink) {
  auto subscription = std::make_unique<Subscription>();
  subscription->channel = channel.name;
  subscription->type = &WireType::Named(type);
  subscription->unrepaired = channel.unrepaired;
  subscription->bus = std::move(bus);
  const bool is_journaled = journaled_.contains(channel.name);
  if (is_journaled) {
    sink.deliver = [this, name = channel.name, deliver = std::move(sink.deliver)](
                       ByteView message, const MessageHeader& header, int64_t arrival_us) {
      WriteJournal(name, message, arrival_us);
      deliver(message, header, arrival_us);
    };
  }
  if (channel.delivery == Delivery::kUnordered) {
    subscription->sink = std::move(sink);
  } else {
    StreamReceiverOptions options = settings_.ReceiverOf(channel.bus);
    options.starts_now = channel.delivery == Delivery::kFromNow;
    options.discards_at_restart = true;  // a frame behind a missing one would be taken for the next
    // A member of the run sends heartbeats, however late on a busy machine; a replayed log has none.
    if (settings_.authenticator && !IsOpen(channel.name)) options.unwatched_us = options.give_up_us;
    subscription->receiver = std::make_unique<ChannelReceiver>(channel.name, options, std::move(sink));
  }
  if (!is_journaled || !journal_->is_replaying()) Open(*subscription);
  subscriptions_.push_back(std::move(subscription));
}

void IncomingStreams::Open(Subscription& subscription) {
  subscription.is_open = true;
  subscription.bus->Subscribe(this, settings_.channel_prefix + subscription.channel,
                              [this, &subscription](const std::string&, ByteView message, int64_t arrival_us) {
                                OnMessage(subscription, message, arrival_us);
                              });
  buses_.push_back(subscription.bus);
}

void IncomingStreams::KeepJournal(const std::set<std::string>& channels, Journal* journal) {
  journaled_ = channels;
  journal_ = journal;
}

// Before the message is handled: what the stage says because of it must be found again.
void IncomingStreams::WriteJournal(const std::string& channel, ByteView message, int64_t arrival_us) {
  if (journal_->is_replaying()) return;
  if (const Result<> written = journal_->Append(channel, message, arrival_us); !written) {
    report_(written.error().sentence);
  }
}

void IncomingStreams::Replay(const Journal::Entry& entry) {
  const auto subscription = std::find_if(subscriptions_.begin(), subscriptions_.end(), [&](const auto& candidate) {
    return candidate->receiver && candidate->channel == entry.channel;
  });
  auto header = ReadHeader(entry.message);
  if (subscription == subscriptions_.end() || !header) return;
  header->is_from_outside = SenderOf(entry.channel, entry.message) == Sender::kOutside;
  (*subscription)->receiver->Replay(*header, entry.message, entry.arrival_us, clock_.NowUs());
}

void IncomingStreams::EndReplay() {
  for (const auto& subscription : subscriptions_) {
    if (!subscription->is_open) Open(*subscription);
  }
}

bool IncomingStreams::IsOpen(const std::string& channel) const {
  return !settings_.camera_is_member && IsSentByCameras(channel);
}

IncomingStreams::Sender IncomingStreams::SenderOf(const std::string& channel, ByteView message) const {
  if (!settings_.authenticator) return Sender::kMember;
  const bool is_open = IsOpen(channel);
  if (is_open && channel != kEndOfStream.name) return Sender::kOutside;
  if (settings_.authenticator->Verify(settings_.channel_prefix + channel, message)) return Sender::kMember;
  return is_open ? Sender::kOutside : Sender::kStranger;
}

// A member's message that is heard again was captured and sent by somebody else. What has an order is judged there.
bool IncomingStreams::IsRepeated(Subscription& subscription, const MessageHeader& header) const {
  if (!settings_.authenticator || subscription.receiver) return false;
  const std::pair number(header.epoch_us, header.sequence);
  const auto [it, is_new] = subscription.newest.try_emplace(header.publisher, number);
  if (is_new) return false;
  if (number <= it->second) return true;
  it->second = number;
  return false;
}

void IncomingStreams::PassOver(const std::string& channel) {
  if (num_strangers_++ == 0) {
    report_("a message on " + channel + " is passed over: no member of this run sent it; STATUS counts all of them");
  }
}

void IncomingStreams::OnMessage(Subscription& subscription, ByteView message, int64_t arrival_us) {
  const Sender sender = SenderOf(subscription.channel, message);
  if (sender == Sender::kStranger) return PassOver(subscription.channel);
  auto header = WireType::Of(message) == subscription.type ? ReadHeader(message) : std::nullopt;
  if (!header) {
    return Refuse(subscription.channel,
                  "its " + std::to_string(message.size()) + " bytes are no " + subscription.type->name());
  }
  header->is_from_outside = sender == Sender::kOutside;
  if (IsRepeated(subscription, *header)) return PassOver(subscription.channel);
  if (!subscription.receiver) {
    subscription.sink.deliver(message, *header, arrival_us);
  } else if (!subscription.receiver->OnMessage(*header, message, arrival_us, clock_.NowUs())) {
    Refuse(subscription.channel, "its number " + std::to_string(header->sequence) + " is implausible");
  }
}

void IncomingStreams::Refuse(const std::string& channel, const std::string& problem) {
  ++num_undecodable_;
  report_("a message on " + channel + " is refused: " + problem);
}

void IncomingStreams::AddAll(const std::shared_ptr<Bus>& bus) {
  if (std::find(raw_buses_.begin(), raw_buses_.end(), bus) != raw_buses_.end()) return;
  bus->Subscribe(this, "", [this](const std::string& channel, ByteView message, int64_t arrival_us) {
    OnRaw(channel, message, arrival_us);
  });
  raw_buses_.push_back(bus);
  buses_.push_back(bus);
}

void IncomingStreams::OnRaw(const std::string& full_channel, ByteView message, int64_t arrival_us) {
  const WireType* type = WireType::Of(message);
  if (IsOneOf(type, {"heartbeat_t", "repair_request_t"})) {
    return;
  }
  const auto header = full_channel.starts_with(settings_.channel_prefix) ? ReadHeader(message) : std::nullopt;
  if (!header) return raw_handler_(full_channel, message, arrival_us);
  const std::string channel = full_channel.substr(settings_.channel_prefix.size());
  if (SenderOf(channel, message) == Sender::kStranger) return PassOver(channel);
  if (HasNoOrder(type)) return raw_handler_(full_channel, message, arrival_us);
  ChannelReceiver* receiver = RawReceiver(channel);
  if (receiver == nullptr || !receiver->OnMessage(*header, message, arrival_us, clock_.NowUs())) {
    raw_handler_(full_channel, message, arrival_us);
  }
}

void IncomingStreams::ContinueRawBehind(const std::string& full_channel, ByteView front) {
  if (!full_channel.starts_with(settings_.channel_prefix) || HasNoOrder(WireType::Of(front))) return;
  const auto header = ReadHeaderOfFront(front);
  ChannelReceiver* receiver = header ? RawReceiver(full_channel.substr(settings_.channel_prefix.size())) : nullptr;
  if (receiver != nullptr) receiver->ContinueBehind(*header, clock_.NowUs());
}

ChannelReceiver* IncomingStreams::RawReceiver(const std::string& channel) {
  const auto it = raw_.find(channel);
  if (it != raw_.end()) return it->second.get();
  if (raw_.size() >= kMaxRawChannels) return nullptr;
  const ChannelReceiver::Sink sink{
      .deliver = [this, full_channel = settings_.channel_prefix + channel](
                     ByteView message, const MessageHeader&,
                     int64_t arrival_us) { raw_handler_(full_channel, message, arrival_us); },
      .lose =
          [this, channel](const std::string& publisher, int64_t num_messages) {
            if (num_messages > 0) {
              report_("the recording lacks " + std::to_string(num_messages) + " messages of " + publisher + " on " +
                      channel + ": no publisher has them any longer");
            }
          }};
  return (raw_[channel] = std::make_unique<ChannelReceiver>(channel, settings_.receiver, sink)).get();
}

void IncomingStreams::AbandonRaw() {
  for (const auto& [channel, receiver] : raw_) receiver->Abandon();
}

void IncomingStreams::OnHeartbeat(const std::string& publisher, const Heartbeat& heartbeat) {
  const int64_t now_us = clock_.NowUs();
  for (const StreamHead& head : heartbeat.streams) {
    for (const auto& subscription : subscriptions_) {
      if (subscription->receiver && subscription->is_open && subscription->channel == head.channel) {
        subscription->receiver->OnHeartbeat(publisher, head, now_us);
      }
    }
    if (!raw_handler_) continue;
    if (ChannelReceiver* receiver = RawReceiver(head.channel)) {
      receiver->OnHeartbeat(publisher, head, now_us);
    }
  }
}

std::vector<RepairRequest> IncomingStreams::Poll() {
  const int64_t now_us = clock_.NowUs();
  std::vector<RepairRequest> requests;
  const auto poll = [&](ChannelReceiver& receiver) {
    std::vector<RepairRequest> more = receiver.Poll(now_us);
    std::move(more.begin(), more.end(), std::back_inserter(requests));
  };
  for (const auto& subscription : subscriptions_) {
    if (subscription->receiver) poll(*subscription->receiver);
  }
  for (const auto& [channel, receiver] : raw_) poll(*receiver);
  return requests;
}

std::optional<int64_t> IncomingStreams::next_poll_us() const {
  std::optional<int64_t> next;
  const auto look = [&](const ChannelReceiver& receiver) {
    const auto poll_us = receiver.next_poll_us();
    if (poll_us && (!next || *poll_us < *next)) next = poll_us;
  };
  for (const auto& subscription : subscriptions_) {
    if (subscription->receiver) look(*subscription->receiver);
  }
  for (const auto& [channel, receiver] : raw_) look(*receiver);
  return next;
}

StreamCounts IncomingStreams::counts() const {
  StreamCounts counts;
  const auto add = [&](const ChannelReceiver& receiver, Unrepaired unrepaired) {
    counts.num_repaired += receiver.counts().num_repaired;
    (unrepaired == Unrepaired::kRequested ? counts.num_repaired : counts.num_lost) += receiver.counts().num_lost;
  };
  for (const auto& subscription : subscriptions_) {
    if (subscription->receiver) add(*subscription->receiver, subscription->unrepaired);
  }
  for (const auto& [channel, receiver] : raw_) add(*receiver, Unrepaired::kLost);
  return counts;
}

}  // namespace tessera
