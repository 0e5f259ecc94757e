// What the settings `bus.*` and `stream.*` mean for streams.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "settings/settings.h"
#include "streams/stream_receiver.h"

namespace tessera {

struct StreamSettings {
  std::string channel_prefix;
  int receive_buffer_bytes = 0;
  size_t max_message_bytes = 0;
  size_t history_bytes = 0;
  int64_t heartbeat_us = 0;
  StreamReceiverOptions receiver;

  static StreamSettings From(const Settings& settings);
};

}  // namespace tessera
