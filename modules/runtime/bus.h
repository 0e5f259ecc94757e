// One LCM bus: a multicast group and port, a log file that is written, or a queue in memory.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "messages/topics.h"
#include "settings/settings.h"
#include "wire/bytes.h"

namespace tessera {

class Bus {
 public:
  // `arrival_us`: wall clock at which the message was received. Must not throw.
  using Handler = std::function<void(const std::string& channel, ByteView message, int64_t arrival_us)>;

  virtual ~Bus() = default;

  // Sends a message. `source_us`: when its content happened by the source's clock, if it has such a time. False if the
  // operating system refused it.
  virtual bool Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) = 0;

  // Whether anything can be heard here; Subscribe does nothing otherwise.
  virtual bool can_listen() const = 0;
  // Calls `handler` for the messages of a channel, or of all if `channel` is empty. `owner` stands for the subscriber.
  // Throws std::runtime_error with one sentence if the network refuses.
  virtual void Subscribe(const void* owner, const std::string& channel, Handler handler) = 0;
  virtual void Unsubscribe(const void* owner) = 0;

  // Readable when a message waits; -1 as long as nobody subscribes.
  virtual int file_descriptor() const = 0;
  // Handles one message if one waits.
  virtual bool HandleOne() = 0;
  // No more will be sent. Throws InputError if what was sent can't be kept (disk full).
  virtual void Close() {}
};

// Opens "udpm://..." or "file://PATH?mode=w". Throws InputError if the URL is neither or the file can't be written, and
// std::runtime_error if the network refuses.
std::shared_ptr<Bus> OpenBus(const std::string& url, int receive_buffer_bytes);

// The URL of the bus that the channel lives on.
std::string UrlOf(const Channel& channel, const Settings& settings);

}  // namespace tessera
