#include "runtime/stream_settings.h"

#include <algorithm>

#include "runtime/run_dir.h"

namespace tessera {
namespace {

// How many messages of this size are asked for at a time: their answer fits the receive buffer.
int MaxAsked(const StreamSettings& settings, size_t message_bytes) {
  return std::clamp(settings.receive_buffer_bytes / 4 / static_cast<int>(message_bytes), 8, 512);
}

}  // namespace

StreamSettings StreamSettings::From(const Settings& settings) {
  const auto bus = settings.Get<BusSettings>();
  const auto stream = settings.Get<StreamTimingSettings>();
  StreamSettings result;
  result.channel_prefix = bus.channel_prefix;
  result.receive_buffer_bytes = bus.receive_buffer_bytes;
  result.max_message_bytes = static_cast<size_t>(bus.max_message_bytes);
  result.max_work_message_bytes = static_cast<size_t>(bus.max_work_message_bytes);
  result.max_local_message_bytes = static_cast<size_t>(bus.max_local_message_bytes);
  result.history_bytes = static_cast<size_t>(stream.history_bytes);
  result.heartbeat_us = 1000LL * stream.heartbeat_ms;
  result.idle_heartbeat_us = 4 * result.heartbeat_us;
  StreamReceiverOptions& receiver = result.receiver;
  receiver.repair_us = 1000LL * stream.repair_ms;
  receiver.give_up_us = 1000LL * stream.give_up_ms;
  receiver.give_up_silent_us = 10 * receiver.give_up_us;
  receiver.silent_us = std::max<int64_t>(500'000, 3 * result.idle_heartbeat_us);
  receiver.unwatched_us = std::max<int64_t>(300'000, 3 * result.heartbeat_us);
  receiver.max_asked = MaxAsked(
      result, std::max({result.max_message_bytes, result.max_work_message_bytes, result.max_local_message_bytes}));
  receiver.max_waiting_bytes = result.history_bytes;
  result.journal_dir = stream.journal_dir;
  result.journal_bytes = 1'000'000LL * stream.journal_mb;
  if (!bus.run_dir.empty()) result.authenticator = std::make_shared<const Authenticator>(ReadRunSecret(bus.run_dir));
  result.camera_is_member = bus.camera_is_member;
  return result;
}

size_t StreamSettings::MaxMessageBytes(BusKind bus) const {
  switch (bus) {
    case BusKind::kMain:
      break;
    case BusKind::kWork:
    case BusKind::kTile:
      return max_work_message_bytes;
    case BusKind::kCamera:
    case BusKind::kColor:
    case BusKind::kMap:
      return max_local_message_bytes;
  }
  return max_message_bytes;
}

StreamReceiverOptions StreamSettings::ReceiverOf(BusKind bus) const {
  StreamReceiverOptions options = receiver;
  options.max_asked = MaxAsked(*this, MaxMessageBytes(bus));
  return options;
}

}  // namespace tessera
