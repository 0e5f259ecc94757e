// What one process sends: its numbered streams, the history they are repaired from, and how far they have come.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/rate_limit.h"
#include "runtime/bus.h"
#include "runtime/stream_settings.h"
#include "streams/stream_history.h"
#include "wire/codec.h"

namespace tessera {

struct StageIdentity {
  std::string name;      // "extractor_2"
  int id = 0;            // the 2 in it
  int64_t epoch_us = 0;  // when it started, wall clock
  std::string host;
  int32_t pid = 0;
};

class OutgoingStreams {
 public:
  OutgoingStreams(const StageIdentity& identity, const StreamSettings& settings);

  // A new stream; returns its number here. `is_repaired`: its messages are kept and announced.
  int Add(const Channel& channel, std::shared_ptr<Bus> bus, bool is_repaired);

  // These channels continue streams that began at `epoch_us` in an earlier life of this process, and are to be added
  // after this. Until EndReplay(), all of their messages are made again: they are kept, and not sent, since they were
  // sent then; who lacks one will ask for it. Values of other ordered streams are passed over.
  void BeginReplay(const std::set<std::string>& channels, int64_t epoch_us);
  void EndReplay() { is_replaying_ = false; }

  // The header of the next value in the stream.
  MessageHeader NextHeader(int stream, int64_t wall_us) const;
  // The largest message that may be encoded for it now.
  size_t MaxMessageBytes(int stream, int64_t now_us) const;
  // Sends the messages of one value. False if the operating system refused one (it will be asked for again).
  bool Send(int stream, std::vector<Bytes> messages, std::optional<int64_t> source_us);

  // What was sent so far is not kept any longer.
  void Forget(int stream) { streams_[static_cast<size_t>(stream)].history.Clear(); }

  // Sends again what is asked for and still there, as fast as receivers can take it; who lacks more asks again.
  void Resend(const RepairRequest& request, int64_t now_us);

  // How far the repaired streams have come, in lots that each fit one message.
  std::vector<Heartbeat> MakeHeartbeats() const;
  const Channel& channel(int stream) const { return streams_[static_cast<size_t>(stream)].channel; }
  // Whether channel `channel` is sent here, and no other process may send on it.
  bool IsExclusive(const std::string& channel) const;

 private:
  struct Stream {
    Channel channel;
    std::string full_name;  // with prefix
    std::shared_ptr<Bus> bus;
    int64_t epoch_us = 0;  // when it began
    bool is_continued = false;
    bool is_repaired = true;
    StreamHistory history;
    int64_t num_sent = 0;
  };
  const StageIdentity identity_;
  const StreamSettings settings_;
  std::vector<Stream> streams_;
  std::set<std::string> continued_;  // channels
  int64_t continued_epoch_us_ = 0;
  bool is_replaying_ = false;
  RateLimit resending_;  // bytes
  RateLimit tolerated_losses_;
  int64_t small_until_us_ = 0;  // many got lost
};

}  // namespace tessera
