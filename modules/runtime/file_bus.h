// A bus that only writes a log: what is published on it can be played by lcm-logplayer and read by LogReader.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "runtime/bus.h"
#include "wire/log_file.h"

namespace tessera {

// Events carry the source's clock, so that a sequence that was recorded as fast as it could be read is played at its
// true pace. A message without such a time takes that of the last one that has it (or, in the beginning, of the first).
class FileBus : public Bus {
 public:
  explicit FileBus(const std::string& path) : writer_(path, Checksums::kBeside) {}

  bool Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) override;
  bool can_listen() const override { return false; }
  void Subscribe(const void* /*owner*/, const std::string& /*channel*/, Handler /*handler*/) override {}
  void Unsubscribe(const void* /*owner*/) override {}
  int file_descriptor() const override { return -1; }
  bool HandleOne() override { return false; }
  void Close() override;

 private:
  void WriteHeld(int64_t time_us);

  LogFileWriter writer_;
  std::optional<int64_t> time_us_;                   // of the last event
  std::vector<std::pair<std::string, Bytes>> held_;  // from before the first time was known
};

}  // namespace tessera
