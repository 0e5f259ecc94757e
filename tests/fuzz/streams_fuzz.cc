// A subscriber's end of a channel: messages and heartbeats of two publishers with any numbers, in any order. Whatever
// is delivered comes in the order of its stream, each message once, and what is asked for can exist.
//
// Input: one event after the other, each a byte that says which, and its numbers.
#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "fuzz/fuzz_target.h"
#include "streams/channel_receiver.h"

namespace tessera {
namespace {

constexpr int64_t kMaxSequence = int64_t{1} << 53;  // that a header may have

// Small numbers, which meet each other, and now and then a huge one.
int64_t TakeSequence(FuzzInput& input) {
  const int64_t number = input.TakeByte();
  if (number < 250) return number;
  int64_t large = 0;
  for (int i = 0; i < 7; ++i) large = (large << 8) + input.TakeByte();
  return std::min(large, kMaxSequence - 1);
}

class Subscriber {
 public:
  explicit Subscriber(bool starts_now)
      : channel_(
            "POSE", {.max_waiting_bytes = 64, .starts_now = starts_now, .discards_at_restart = true},
            {.deliver = [this](ByteView, const MessageHeader& header, int64_t) { Deliver(header); },
             .lose = [](const std::string&, int64_t number) { Expect(number >= 0, "less than nothing is lost"); }}) {}

  void Step(FuzzInput& input) {
    const uint8_t event = input.TakeByte();
    const std::string publisher = event & 1 ? "one" : "other";
    const int64_t epoch_us = 1 + (event >> 1) % 3;
    switch ((event >> 3) % 4) {
      case 0:
      case 1:
        Send(publisher, epoch_us, input);
        break;
      case 2: {
        const int64_t first = TakeSequence(input), next = first + TakeSequence(input);
        const StreamHead head{.channel = "POSE", .epoch_us = epoch_us, .first_sequence = first, .next_sequence = next};
        channel_.OnHeartbeat(publisher, head, now_us_);
        break;
      }
      default:
        now_us_ += 10'000 * int64_t{input.TakeByte()};
        Poll();
    }
  }
  void End() { channel_.Abandon(); }

 private:
  void Send(const std::string& publisher, int64_t epoch_us, FuzzInput& input) {
    MessageHeader header{.publisher = publisher, .epoch_us = epoch_us, .sequence = TakeSequence(input)};
    header.part = static_cast<int32_t>(std::min<int64_t>(input.TakeByte() % 3, header.sequence));
    header.num_parts = 3;
    const std::array<uint8_t, 10> bytes{};
    channel_.OnMessage(header, bytes, now_us_, now_us_);
  }
  void Poll() {
    for (const RepairRequest& request : channel_.Poll(now_us_)) {
      int64_t behind = 0;
      for (const SequenceRange& range : request.ranges) {
        Expect(range.first >= behind && range.last >= range.first, "ranges of a request are not in order");
        behind = range.last + 1;
      }
    }
    Expect(channel_.counts().num_lost >= 0 && channel_.counts().num_repaired >= 0, "counts are negative");
  }
  void Deliver(const MessageHeader& header) {
    const std::pair number(header.epoch_us, header.sequence);
    const auto [it, is_new] = last_.try_emplace(header.publisher, number);
    Expect(is_new || number > it->second, "a message was delivered again or out of order");
    it->second = number;
  }

  ChannelReceiver channel_;
  std::map<std::string, std::pair<int64_t, int64_t>> last_;  // by publisher: epoch and number
  int64_t now_us_ = 1'000'000;
};

}  // namespace

std::vector<std::string> Seeds() {
  const auto text = [](std::initializer_list<int> bytes) { return std::string(bytes.begin(), bytes.end()); };
  return {text({0, 0, 0, 0, 0, 1, 0, 0, 3, 0, 24, 1, 16, 0, 4, 24, 2, 0, 2, 0}),
          text({1, 0, 5, 0, 16, 0, 9, 24, 40, 0, 7, 0, 24, 200, 2, 0, 0, 0, 18, 1, 3, 24, 255})};
}

void Read(std::string_view text) {
  FuzzInput input(text);
  Subscriber subscriber(input.TakeByte() % 2 == 1);
  while (!input.is_empty()) subscriber.Step(input);
  subscriber.End();
}

}  // namespace tessera
