// What a publisher keeps of one stream: its last messages, so that they can be sent again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "wire/bytes.h"

namespace tessera {

class StreamHistory {
 public:
  // Messages are kept up to `max_bytes` in all, and the newest one always.
  explicit StreamHistory(size_t max_bytes) : max_bytes_(max_bytes) {}

  // Keeps the message, which is number next().
  const Bytes& Append(Bytes message);

  // Keeps none of them any longer.
  void Clear();

  int64_t first() const { return next_ - static_cast<int64_t>(entries_.size()); }  // oldest that is kept
  int64_t next() const { return next_; }

  // The message, if it is kept and was not sent again within the last `pause_us`: several subscribers may lack it, and
  // one answer serves them all. Null otherwise.
  const Bytes* Resend(int64_t sequence, int64_t now_us, int64_t pause_us);

 private:
  struct Entry {
    Bytes message;
    int64_t resent_us = INT64_MIN / 2;
  };
  size_t max_bytes_;
  size_t num_bytes_ = 0;
  int64_t next_ = 0;
  std::deque<Entry> entries_;
};

}  // namespace tessera
