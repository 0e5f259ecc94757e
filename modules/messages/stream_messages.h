// What publishers and subscribers tell each other so that nothing is lost in silence (HEARTBEAT, REPAIR).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

// How far one stream has come.
struct StreamHead {
  std::string channel;         // without prefix
  int64_t epoch_us = 0;        // when it began: when its publisher started, or an earlier life that this one continues
  int64_t first_sequence = 0;  // oldest message that can still be repaired
  int64_t next_sequence = 0;   // number that the next message will have
  bool is_exclusive = false;   // a second publisher on this channel is an error

  bool operator==(const StreamHead&) const = default;
};

// A process lives, and its streams have come so far. One with many streams sends several.
struct Heartbeat {
  std::string host;
  int32_t pid = 0;
  std::vector<StreamHead> streams;

  bool operator==(const Heartbeat&) const = default;
};

// Messages first .. last of a stream.
struct SequenceRange {
  int64_t first = 0;
  int64_t last = 0;

  bool operator==(const SequenceRange&) const = default;
};

// A subscriber lacks these messages of a publisher's stream.
struct RepairRequest {
  std::string channel;  // without prefix
  std::string publisher;
  int64_t epoch_us = 0;  // when the stream began
  std::vector<SequenceRange> ranges;

  bool operator==(const RepairRequest&) const = default;
};

}  // namespace tessera
