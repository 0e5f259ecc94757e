// What one process hears: its subscriptions, put in order and repaired.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bus.h"
#include "runtime/clock.h"
#include "runtime/journal.h"
#include "runtime/stream_settings.h"
#include "streams/channel_receiver.h"
#include "wire/wire_type.h"

namespace tessera {

class IncomingStreams {
 public:
  // `report` gets one sentence for each message that is refused or lost.
  IncomingStreams(const StreamSettings& settings, const Clock& clock, std::function<void(const std::string&)> report);
  ~IncomingStreams();
  IncomingStreams(const IncomingStreams&) = delete;
  IncomingStreams& operator=(const IncomingStreams&) = delete;

  // Gives messages of the channel, which must be of type `type` ("pose_t"), to `sink`, in the way that their delivery
  // asks for. Throws std::runtime_error if the network refuses.
  void Add(const Channel& channel, const char* type, std::shared_ptr<Bus> bus, ChannelReceiver::Sink sink);

  // Everything on a bus, for recording: streams in order and repaired from their first message on, what has no order as
  // it comes, what is not this project's too. HEARTBEAT and REPAIR are left out: played again, they would speak of
  // publishers that are gone.
  using RawHandler = std::function<void(const std::string& channel, ByteView message, int64_t arrival_us)>;
  void SetRawHandler(RawHandler handler) { raw_handler_ = std::move(handler); }
  void AddAll(const std::shared_ptr<Bus>& bus);
  // An earlier life took this message (`channel` with prefix; the front is enough): its stream continues behind it.
  void ContinueRawBehind(const std::string& full_channel, ByteView front);
  bool hears_all() const { return raw_handler_ != nullptr; }

  // The recording ends: delivers what waits behind gaps, and reports the gaps.
  void AbandonRaw();

  // Unsubscribes from everything.
  void Close();

  // What is delivered on these channels, which are to be added after this, goes into the journal before. As long as
  // that one is replayed, nothing else is heard on them.
  void KeepJournal(const std::set<std::string>& channels, Journal* journal);
  // Behind what is in the journal; nothing as long as that is replayed.
  void WriteJournal(const std::string& channel, ByteView message, int64_t arrival_us);
  // Delivers a message that was delivered in an earlier life.
  void Replay(const Journal::Entry& entry);
  // All that is in the journal was replayed: listens to its channels.
  void EndReplay();

  void OnHeartbeat(const std::string& publisher, const Heartbeat& heartbeat);
  // To be called when no message waits: what has to be asked for now.
  std::vector<RepairRequest> Poll();
  // When Poll has something to do, by the clock; nullopt: not before something comes.
  std::optional<int64_t> next_poll_us() const;

  // What is lost on a channel where that is made up for counts as repaired.
  StreamCounts counts() const;
  int64_t num_undecodable() const { return num_undecodable_; }
  // Messages that were passed over: no member of the run sent them, or they were heard before.
  int64_t num_strangers() const { return num_strangers_; }
  // Counts and reports a message that was refused, after its header had been found good.
  void Refuse(const std::string& channel, const std::string& problem);

 private:
  // One Add().
  struct Subscription {
    std::string channel;
    const WireType* type = nullptr;
    Unrepaired unrepaired = Unrepaired::kLost;
    std::unique_ptr<ChannelReceiver> receiver;  // null: unordered
    ChannelReceiver::Sink sink;
    std::shared_ptr<Bus> bus;
    bool is_open = false;  // is listened to
    // Unordered: the newest message of each publisher, by epoch and sequence number.
    std::map<std::string, std::pair<int64_t, int64_t>> newest;
  };
  enum class Sender { kMember, kOutside, kStranger };
  void Open(Subscription& subscription);
  void OnMessage(Subscription& subscription, ByteView message, int64_t arrival_us);
  // Whether a camera outside of the run may speak on the channel (without prefix).
  bool IsOpen(const std::string& channel) const;
  // Who sent a message on the channel (without prefix). All are members where messages are not checked.
  Sender SenderOf(const std::string& channel, ByteView message) const;
  bool IsRepeated(Subscription& subscription, const MessageHeader& header) const;
  void PassOver(const std::string& channel);
  void OnRaw(const std::string& full_channel, ByteView message, int64_t arrival_us);
  ChannelReceiver* RawReceiver(const std::string& channel);

  const StreamSettings settings_;
  const Clock& clock_;
  std::function<void(const std::string&)> report_;
  std::vector<std::shared_ptr<Bus>> buses_;  // that are subscribed to
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  Journal* journal_ = nullptr;
  std::set<std::string> journaled_;  // channels
  RawHandler raw_handler_;           // set while everything is recorded
  std::vector<std::shared_ptr<Bus>> raw_buses_;
  std::map<std::string, std::unique_ptr<ChannelReceiver>> raw_;  // by channel, without prefix
  int64_t num_undecodable_ = 0;
  int64_t num_strangers_ = 0;
};

}  // namespace tessera
