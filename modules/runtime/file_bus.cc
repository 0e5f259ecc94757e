#include "runtime/file_bus.h"

#include <algorithm>

namespace tessera {

bool FileBus::Publish(const std::string& channel, ByteView message, std::optional<int64_t> source_us) {
  if (source_us) {
    // Time never runs back in a log.
    time_us_ = time_us_ ? std::max(*time_us_, *source_us) : *source_us;
    WriteHeld(*time_us_);
  }
  if (time_us_) {
    writer_.Write(*time_us_, channel, message);
  } else {
    held_.emplace_back(channel, Bytes(message.begin(), message.end()));
  }
  return true;
}

void FileBus::WriteHeld(int64_t time_us) {
  for (const auto& [channel, message] : held_) {
    writer_.Write(time_us, channel, message);
  }
  held_.clear();
}

void FileBus::Close() {
  WriteHeld(0);
  writer_.Close();
}

}  // namespace tessera
