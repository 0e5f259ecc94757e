// Who else is on the bus, so that a second process with the same name, or a second tracker, is found out.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "runtime/outgoing_streams.h"
#include "wire/codec.h"

namespace tessera {

class Neighbors {
 public:
  explicit Neighbors(const StageIdentity& own) : own_(own) {}

  // Returns whether it is of a process that was not heard of within the last second.
  bool OnHeartbeat(const std::string& publisher, int64_t epoch_us, const Heartbeat& heartbeat, int64_t now_us);

  // Of two processes in conflict the one that started later has to end. These give its sentence if that is this one,
  // and the other was heard of within the last second.
  std::optional<std::string> ConflictOverName(int64_t now_us) const;
  std::optional<std::string> ConflictOverChannel(const std::string& channel, int64_t now_us) const;

 private:
  struct Neighbor {
    std::string name;
    std::string host;
    int32_t pid = 0;
    int64_t heard_us = 0;
    std::set<std::string> exclusive_channels;
  };
  bool IsAliveAndOlder(int64_t epoch_us, const Neighbor& neighbor, int64_t now_us) const;

  const StageIdentity own_;
  std::multimap<int64_t, Neighbor> neighbors_;  // by the time at which they started
};

}  // namespace tessera
