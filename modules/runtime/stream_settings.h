// What the settings `bus.*` and `stream.*` mean for streams.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "messages/topics.h"
#include "settings/settings.h"
#include "streams/authenticator.h"
#include "streams/stream_receiver.h"

namespace tessera {

struct StreamSettings {
  std::string channel_prefix;
  int receive_buffer_bytes = 0;
  size_t max_message_bytes = 0;
  size_t max_work_message_bytes = 0;   // of the buses of tiles and their features
  size_t max_local_message_bytes = 0;  // of the buses of camera and map
  size_t history_bytes = 0;
  int64_t heartbeat_us = 0;
  int64_t idle_heartbeat_us = 0;  // of a process that sent nothing for a while
  StreamReceiverOptions receiver;
  std::string journal_dir;  // empty: no journals are kept
  int64_t journal_bytes = 0;
  std::shared_ptr<const Authenticator> authenticator;  // null: messages are neither signed nor checked
  bool camera_is_member = true;

  // Throws InputError if the run's secret can't be read.
  static StreamSettings From(const Settings& settings);

  size_t MaxMessageBytes(BusKind bus) const;
  // How a stream of this bus is received.
  StreamReceiverOptions ReceiverOf(BusKind bus) const;
};

}  // namespace tessera
