#include "streams/stream_receiver.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

// A message this far ahead of all that is known of its stream is refused.
constexpr int64_t kMaxAhead = int64_t{1} << 20;

}  // namespace

StreamReceiver::StreamReceiver(const StreamReceiverOptions& options, Sink sink)
    : options_(options), sink_(std::move(sink)) {}

bool StreamReceiver::OnMessage(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us) {
  const int64_t sequence = header.sequence;
  const bool knows_anything = is_started_ || !waiting_.empty();
  if (knows_anything && sequence > std::max(head_, next_) + kMaxAhead) {
    return false;
  }
  if (!first_heard_us_) first_heard_us_ = now_us;
  if (!is_started_ && (sequence == 0 || options_.starts_now)) {
    Start(sequence - header.part);
  }
  head_ = std::max(head_, sequence + 1);
  if (asked_.erase(sequence) > 0) {
    ++counts_.num_repaired;
    NoteProgress(now_us);
    // The last of what was asked for has come: if more is missing, it is asked for at once.
    if (asked_.empty()) ask_us_ = now_us;
  } else if (gap_is_noted_ && is_started_ && sequence == next_) {
    NoteProgress(now_us);
  }
  if ((is_started_ && sequence < next_) || waiting_.contains(sequence)) {
    return true;
  }
  if (is_started_ && sequence == next_) {
    ++next_;
    sink_.deliver(message, header, arrival_us);
    DeliverWaiting();
  } else if (num_waiting_bytes_ + message.size() <= options_.max_waiting_bytes) {
    waiting_[sequence] = {header, Bytes(message.begin(), message.end()), arrival_us};
    num_waiting_bytes_ += message.size();
  }
  NoteGap(options_.repair_us, now_us);
  return true;
}

void StreamReceiver::Replay(const MessageHeader& header, ByteView message, int64_t arrival_us, int64_t now_us) {
  const int64_t num_lost = is_started_ ? header.sequence - next_ : 0;
  ContinueBehind(header, now_us);
  if (num_lost > 0) {
    counts_.num_lost += num_lost;
    sink_.lose(num_lost);
  }
  sink_.deliver(message, header, arrival_us);
}

void StreamReceiver::ContinueBehind(const MessageHeader& header, int64_t now_us) {
  heartbeat_us_ = now_us;
  is_started_ = true;
  next_ = head_ = header.sequence + 1;
}

void StreamReceiver::OnHeartbeat(int64_t first, int64_t next, int64_t now_us) {
  if (next > kMaxAhead + (is_started_ ? std::max(head_, next_) : first)) {
    return;
  }
  heartbeat_us_ = now_us;
  first_available_ = std::max(first_available_, first);
  head_ = std::max(head_, next);
  if (is_started_) {
    NoteGap(options_.repair_us, now_us);
    return;
  }
  Start(options_.starts_now ? next : first);
  NoteGap(0,
          now_us);  // what was sent before this subscriber existed will not arrive by itself: it is asked for at once
}

void StreamReceiver::Start(int64_t sequence) {
  is_started_ = true;
  next_ = sequence;
  while (!waiting_.empty() && waiting_.begin()->first < next_) {
    num_waiting_bytes_ -= waiting_.begin()->second.message.size();
    waiting_.erase(waiting_.begin());
  }
  DeliverWaiting();
}

void StreamReceiver::DeliverWaiting() {
  for (auto it = waiting_.begin(); it != waiting_.end() && it->first == next_; it = waiting_.begin()) {
    const Waiting waiting = std::move(it->second);
    waiting_.erase(it);
    num_waiting_bytes_ -= waiting.message.size();
    ++next_;
    sink_.deliver(waiting.message, waiting.header, waiting.arrival_us);
  }
  head_ = std::max(head_, next_);
  gap_is_noted_ = gap_is_noted_ && HasGap();
}

// The messages from next_ up to `end`, or up to the first one that is there, are lost.
void StreamReceiver::Skip(int64_t end) {
  const int64_t behind = waiting_.empty() ? end : std::min(end, waiting_.begin()->first);
  const int64_t num_lost = behind - next_;
  counts_.num_lost += num_lost;
  asked_.erase(asked_.begin(), asked_.lower_bound(behind));
  next_ = behind;
  sink_.lose(num_lost);
  DeliverWaiting();
}

void StreamReceiver::NoteGap(int64_t delay_us, int64_t now_us) {
  if (!HasGap() || gap_is_noted_) return;
  gap_is_noted_ = true;
  interval_us_ = options_.repair_us;
  ask_us_ = now_us + delay_us;
  progress_us_ = now_us;
}

void StreamReceiver::NoteProgress(int64_t now_us) {
  progress_us_ = now_us;
  interval_us_ = options_.repair_us;
  ask_us_ = now_us + interval_us_;
}

int64_t StreamReceiver::GiveUpTime(int64_t now_us) const {
  if (!heartbeat_us_) {
    return progress_us_ + options_.unwatched_us;
  }
  const bool is_silent = now_us - *heartbeat_us_ > options_.silent_us;
  return progress_us_ + (is_silent ? options_.give_up_silent_us : options_.give_up_us);
}

std::vector<SequenceRange> StreamReceiver::Poll(int64_t now_us) {
  if (!is_started_) {
    // Nobody says where the stream begins: with the first message that came.
    if (first_heard_us_ && now_us - *first_heard_us_ >= options_.unwatched_us && !waiting_.empty()) {
      Start(waiting_.begin()->first);
      NoteGap(options_.repair_us, now_us);
    }
    return {};
  }
  while (HasGap() && next_ < first_available_) {
    Skip(std::min(first_available_, head_));
  }
  if (HasGap() && now_us >= GiveUpTime(now_us)) {
    Skip(head_);
    progress_us_ = now_us;
  }
  NoteGap(options_.repair_us, now_us);
  if (!HasGap() || !heartbeat_us_ || now_us < ask_us_) {
    return {};
  }
  return Ask(now_us);
}

std::vector<SequenceRange> StreamReceiver::Ask(int64_t now_us) {
  asked_.clear();
  std::vector<SequenceRange> ranges;
  auto waiting = waiting_.begin();
  for (int64_t sequence = next_; sequence < head_ && static_cast<int>(asked_.size()) < options_.max_asked; ++sequence) {
    while (waiting != waiting_.end() && waiting->first < sequence) ++waiting;
    if (waiting != waiting_.end() && waiting->first == sequence) continue;
    asked_.insert(sequence);
    if (!ranges.empty() && ranges.back().last == sequence - 1) {
      ranges.back().last = sequence;
    } else {
      ranges.push_back({sequence, sequence});
    }
  }
  ask_us_ = now_us + interval_us_;
  interval_us_ = std::min(2 * interval_us_, options_.max_repair_us);
  return ranges;
}

std::optional<int64_t> StreamReceiver::next_poll_us() const {
  if (!is_started_) {
    return waiting_.empty() || !first_heard_us_ ? std::nullopt
                                                : std::optional(*first_heard_us_ + options_.unwatched_us);
  }
  if (!HasGap()) return std::nullopt;
  if (!heartbeat_us_) return progress_us_ + options_.unwatched_us;
  // Giving up is looked at together with asking, which is never far off.
  return next_ < first_available_ ? progress_us_ : ask_us_;
}

void StreamReceiver::Abandon() {
  if (!is_started_ && !waiting_.empty()) Start(waiting_.begin()->first);
  while (HasGap()) Skip(head_);
}

}  // namespace tessera
