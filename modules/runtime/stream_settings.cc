#include "runtime/stream_settings.h"

#include <algorithm>
#include <cctype>

#include "core/errors.h"
#include "messages/topics.h"

namespace tessera {
namespace {

int GetBetween(const Settings& settings, const std::string& key, int lowest, int highest) {
  const int value = settings.Get<int>(key);
  if (value < lowest || value > highest) {
    throw InputError("setting " + key + " = " + std::to_string(value) + " must be between " + std::to_string(lowest) +
                     " and " + std::to_string(highest));
  }
  return value;
}

// LCM takes channel names for regular expressions, and has room for 63 characters.
std::string GetPrefix(const Settings& settings) {
  const auto prefix = settings.Get<std::string>("bus.channel_prefix");
  const bool is_plain = std::all_of(prefix.begin(), prefix.end(), [](unsigned char c) {
    return (std::isalnum(c) != 0 && c < 128) || c == '_' || c == '-' || c == '/';
  });
  if (!is_plain || prefix.size() > 32) {
    throw InputError("setting bus.channel_prefix = `" + prefix + "` must have at most 32 letters, digits, _, - and /");
  }
  return prefix;
}

}  // namespace

StreamSettings StreamSettings::From(const Settings& settings) {
  StreamSettings result;
  result.channel_prefix = GetPrefix(settings);
  // Each extractor has a port of its own.
  GetBetween(settings, "bus.first_tile_port", 1, 65536 - kMaxExtractors);
  result.receive_buffer_bytes = GetBetween(settings, "bus.receive_buffer_bytes", 1 << 16, 1 << 30);
  // Above 65,499 bytes LCM would cut messages into fragments, whose loss nobody could repair one by one.
  result.max_message_bytes = static_cast<size_t>(GetBetween(settings, "bus.max_message_bytes", 1000, 65000));
  result.history_bytes = static_cast<size_t>(GetBetween(settings, "stream.history_bytes", 1 << 16, 1 << 30));
  result.heartbeat_us = 1000LL * GetBetween(settings, "stream.heartbeat_ms", 1, 10'000);
  StreamReceiverOptions& receiver = result.receiver;
  receiver.repair_us = 1000LL * GetBetween(settings, "stream.repair_ms", 1, 10'000);
  receiver.give_up_us = 1000LL * GetBetween(settings, "stream.give_up_ms", 1, 1'000'000);
  receiver.give_up_silent_us = 10 * receiver.give_up_us;
  receiver.silent_us = std::max<int64_t>(500'000, 5 * result.heartbeat_us);
  receiver.unwatched_us = std::max<int64_t>(300'000, 3 * result.heartbeat_us);
  receiver.max_asked = std::clamp(result.receive_buffer_bytes / 4 / static_cast<int>(result.max_message_bytes), 8, 512);
  receiver.max_waiting_bytes = result.history_bytes;
  return result;
}

}  // namespace tessera
