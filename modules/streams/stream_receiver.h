// A subscriber's end of one stream: delivers the messages in order, each once, and says which ones to ask for again.
// It knows no network and no clock: time is passed in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "messages/stream_messages.h"
#include "wire/bytes.h"
#include "wire/codec.h"

namespace tessera {

struct StreamReceiverOptions {
  int64_t repair_us = 10'000;              // a gap is asked for after this long, and again at doubled intervals
  int64_t max_repair_us = 500'000;         // up to this one
  int64_t give_up_us = 3'000'000;          // without progress for this long a gap is skipped, if the publisher lives
  int64_t give_up_silent_us = 30'000'000;  // the same for a publisher that says nothing: it may be in a long step
  int64_t unwatched_us = 300'000;  // a publisher without any heartbeat for this long (a replayed log) won't repair
  int64_t silent_us = 500'000;     // without a heartbeat for this long a publisher counts as silent
  int max_asked = 32;              // messages asked for at a time, so that the answer fits the receive buffer
  size_t max_waiting_bytes = size_t{1} << 26;  // kept behind a gap; what comes beyond is dropped and asked for again
  bool starts_now = false;  // begin with what is sent from now on, not with what the publisher still has
  // What waits behind a gap when the publisher is started again is not delivered: its successor sends it again.
  bool discards_at_restart = false;
};

struct StreamCounts {
  int64_t num_repaired = 0;  // messages that came after being asked for
  int64_t num_lost = 0;      // messages that never came
};

class StreamReceiver {
 public:
  // Called in order of the stream.
  struct Sink {
    std::function<void(ByteView message, const MessageHeader& header, int64_t arrival_us)> deliver;
    std::function<void(int64_t num_messages)> lose;  // these messages won't come; the next one is behind them
  };
  StreamReceiver(const StreamReceiverOptions& options, Sink sink);

  // A message of the stream came. False if its number is implausible (far beyond all that is known).
  bool OnMessage(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us);
  // A message that was delivered in an earlier life comes again, before anything else comes: it is delivered, and the
  // stream continues behind it. Its publisher counts as heard.
  void Replay(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us);
  // The messages up to this one were taken in an earlier life: the stream continues behind it.
  void ContinueBehind(const MessageHeader& header, int64_t now_us);
  // The publisher says that it has messages first .. next - 1.
  void OnHeartbeat(int64_t first, int64_t next, int64_t now_us);

  // To be called when no message waits to be handled: what is still missing then was lost, or is late. Returns
  // the messages to ask for now; may give some up.
  std::vector<SequenceRange> Poll(int64_t now_us);
  // When Poll has something to do; nullopt: not before something comes.
  std::optional<int64_t> next_poll_us() const;

  // The stream is over: delivers what has arrived and counts what is missing.
  void Abandon();

  const StreamCounts& counts() const { return counts_; }

 private:
  struct Waiting {
    MessageHeader header;
    Bytes message;
    int64_t arrival_us = 0;
  };

  void Start(int64_t sequence);
  void DeliverWaiting();
  void Skip(int64_t end);
  bool HasGap() const { return is_started_ && next_ < head_; }
  void NoteGap(int64_t delay_us, int64_t now_us);
  void NoteProgress(int64_t now_us);
  int64_t GiveUpTime(int64_t now_us) const;
  std::vector<SequenceRange> Ask(int64_t now_us);

  StreamReceiverOptions options_;
  Sink sink_;
  StreamCounts counts_;
  bool is_started_ = false;
  int64_t next_ = 0;                    // to be delivered next
  int64_t head_ = 0;                    // messages below this number are known to exist
  int64_t first_available_ = 0;         // the publisher has none below
  std::map<int64_t, Waiting> waiting_;  // by number: came before their turn
  size_t num_waiting_bytes_ = 0;
  std::set<int64_t> asked_;  // asked for and not come
  bool gap_is_noted_ = false;
  int64_t ask_us_ = 0;       // when the gap is to be asked for (again)
  int64_t interval_us_ = 0;  // until the time after that
  int64_t progress_us_ = 0;  // when the gap was found or got smaller
  std::optional<int64_t> first_heard_us_;
  std::optional<int64_t> heartbeat_us_;  // the last one
};

}  // namespace tessera
