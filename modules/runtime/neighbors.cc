#include "runtime/neighbors.h"

#include <tuple>

namespace tessera {
namespace {

constexpr int64_t kMemoryUs = 1'000'000;
constexpr size_t kMaxNeighbors = 1000;

std::string Describe(const std::string& name, const std::string& host, int32_t pid) {
  return name + " (process " + std::to_string(pid) + " on " + host + ")";
}

}  // namespace

bool Neighbors::OnHeartbeat(const std::string& publisher, int64_t epoch_us, const Heartbeat& heartbeat,
                            int64_t now_us) {
  if (epoch_us == own_.epoch_us && heartbeat.pid == own_.pid && heartbeat.host == own_.host) {
    return false;
  }
  std::erase_if(neighbors_, [&](const auto& entry) { return now_us - entry.second.heard_us > kMemoryUs; });
  const auto [begin, end] = neighbors_.equal_range(epoch_us);
  auto it = begin;
  while (it != end && (it->second.name != publisher || it->second.pid != heartbeat.pid)) ++it;
  const bool is_new = it == end;
  if (is_new) {
    if (neighbors_.size() >= kMaxNeighbors) return false;
    it = neighbors_.emplace(epoch_us, Neighbor{publisher, heartbeat.host, heartbeat.pid, 0, {}});
  }
  it->second.heard_us = now_us;
  for (const StreamHead& stream : heartbeat.streams) {
    if (stream.is_exclusive) it->second.exclusive_channels.insert(stream.channel);
  }
  return is_new;
}

bool Neighbors::IsAliveAndOlder(int64_t epoch_us, const Neighbor& neighbor, int64_t now_us) const {
  return now_us - neighbor.heard_us <= kMemoryUs &&
         std::tie(epoch_us, neighbor.host, neighbor.pid) < std::tie(own_.epoch_us, own_.host, own_.pid);
}

std::optional<std::string> Neighbors::ConflictOverName(int64_t now_us) const {
  for (const auto& [epoch_us, neighbor] : neighbors_) {
    if (neighbor.name == own_.name && IsAliveAndOlder(epoch_us, neighbor, now_us)) {
      return "another process has this name already: " + Describe(neighbor.name, neighbor.host, neighbor.pid) +
             "; end it, give this one another --name, or set other ports in bus.*_url";
    }
  }
  return std::nullopt;
}

std::optional<std::string> Neighbors::ConflictOverChannel(const std::string& channel, int64_t now_us) const {
  for (const auto& [epoch_us, neighbor] : neighbors_) {
    if (neighbor.exclusive_channels.contains(channel) && IsAliveAndOlder(epoch_us, neighbor, now_us)) {
      return "channel " + channel +
             " already has a publisher: " + Describe(neighbor.name, neighbor.host, neighbor.pid) +
             "; end it, or set other ports in bus.*_url for this one";
    }
  }
  return std::nullopt;
}

}  // namespace tessera
