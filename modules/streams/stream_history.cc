#include "streams/stream_history.h"

#include <utility>

namespace tessera {

const Bytes& StreamHistory::Append(Bytes message) {
  num_bytes_ += message.size();
  entries_.push_back({.message = std::move(message)});
  ++next_;
  while (num_bytes_ > max_bytes_ && entries_.size() > 1) {
    num_bytes_ -= entries_.front().message.size();
    entries_.pop_front();
  }
  return entries_.back().message;
}

void StreamHistory::Clear() {
  entries_.clear();
  num_bytes_ = 0;
}

const Bytes* StreamHistory::Resend(int64_t sequence, int64_t now_us, int64_t pause_us) {
  if (sequence < first() || sequence >= next_) {
    return nullptr;
  }
  Entry& entry = entries_[static_cast<size_t>(sequence - first())];
  if (now_us - entry.resent_us < pause_us) {
    return nullptr;
  }
  entry.resent_us = now_us;
  return &entry.message;
}

}  // namespace tessera
