// Streams over a network that loses, doubles and reorders, by a seeded simulation with a clock of its own.
#include "streams/stream_receiver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>

#include "streams/stream_history.h"

namespace tessera {
namespace {

constexpr int64_t kHeartbeatUs = 100'000;

Bytes MessageOf(int64_t sequence) {
  return {static_cast<uint8_t>(sequence), static_cast<uint8_t>(sequence >> 8), 0, 0, 0, 0, 0, 0};
}

struct NetworkOptions {
  double loss = 0.0;           // share of messages, and of heartbeats and requests, that never arrive
  double doubling = 0.0;       // share that arrives twice
  int64_t max_delay_us = 100;  // they overtake each other
};

// One publisher, one subscriber, and what is on its way between them.
class Simulation {
 public:
  Simulation(unsigned seed, const NetworkOptions& network, StreamReceiverOptions options = {},
             size_t history_bytes = size_t{1} << 20)
      : generator_(seed),
        network_(network),
        history_(history_bytes),
        receiver_(options, {.deliver =
                                [this](ByteView message, const MessageHeader& header, int64_t) {
                                  EXPECT_EQ(Bytes(message.begin(), message.end()), MessageOf(header.sequence));
                                  delivered_.push_back(header.sequence);
                                },
                            .lose = [this](int64_t num_messages) { lost_.push_back(num_messages); }}) {}

  // From here on the subscriber hears.
  void Join() { has_joined_ = true; }
  void StopPublisher() { publisher_is_gone_ = true; }

  void Publish() {
    const int64_t sequence = history_.next();
    history_.Append(MessageOf(sequence));
    Send([this, sequence] { receiver_.OnMessage(HeaderOf(sequence), MessageOf(sequence), now_us_, now_us_); });
  }
  void Run(int64_t duration_us) {
    const int64_t end_us = now_us_ + duration_us;
    for (; now_us_ < end_us; now_us_ += 100) {
      if (!publisher_is_gone_ && now_us_ % kHeartbeatUs == 0) {
        Send([this, first = history_.first(), next = history_.next()] { receiver_.OnHeartbeat(first, next, now_us_); });
      }
      while (!on_their_way_.empty() && on_their_way_.begin()->first <= now_us_) {
        const auto arrive = on_their_way_.begin()->second;
        on_their_way_.erase(on_their_way_.begin());
        if (has_joined_) arrive();
      }
      Repair();
    }
  }

  const std::vector<int64_t>& delivered() const { return delivered_; }
  const StreamReceiver& receiver() const { return receiver_; }
  int64_t num_requests() const { return num_requests_; }

  // Delivered were first .. last, each once, in order.
  void ExpectDelivered(int64_t first, int64_t last) const {
    ASSERT_EQ(delivered_.size(), static_cast<size_t>(last - first + 1));
    for (size_t i = 0; i < delivered_.size(); ++i) ASSERT_EQ(delivered_[i], first + static_cast<int64_t>(i));
  }

 private:
  static MessageHeader HeaderOf(int64_t sequence) { return {.publisher = "p", .epoch_us = 1, .sequence = sequence}; }
  bool Happens(double share) { return std::uniform_real_distribution<double>(0, 1)(generator_) < share; }
  void Send(const std::function<void()>& arrive) {
    for (int copies = Happens(network_.doubling) ? 2 : 1; copies > 0; --copies) {
      if (Happens(network_.loss)) continue;
      const auto delay_us = static_cast<int64_t>(generator_() % static_cast<uint64_t>(network_.max_delay_us + 1));
      on_their_way_.emplace(now_us_ + delay_us, arrive);
    }
  }
  void Repair() {
    const auto poll_us = receiver_.next_poll_us();
    if (!has_joined_ || !poll_us || *poll_us > now_us_) return;
    for (const SequenceRange& range : receiver_.Poll(now_us_)) {
      ++num_requests_;
      Send([this, range] {
        if (publisher_is_gone_) return;
        for (int64_t i = range.first; i <= range.last; ++i) {
          if (history_.Resend(i, now_us_, 5000) == nullptr) continue;
          Send([this, i] { receiver_.OnMessage(HeaderOf(i), MessageOf(i), now_us_, now_us_); });
        }
      });
    }
  }

  std::mt19937_64 generator_;
  NetworkOptions network_;
  StreamHistory history_;
  StreamReceiver receiver_;
  std::multimap<int64_t, std::function<void()>> on_their_way_;  // by arrival
  int64_t now_us_ = 1'000'000;
  bool has_joined_ = false;
  bool publisher_is_gone_ = false;
  int64_t num_requests_ = 0;
  std::vector<int64_t> delivered_;
  std::vector<int64_t> lost_;
};

TEST(Stream, EverythingComesOnceAndInOrderThroughABadNetwork) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    Simulation stream(seed, {.loss = 0.2, .doubling = 0.1, .max_delay_us = 3000});
    stream.Join();
    for (int i = 0; i < 500; ++i) {
      stream.Publish();
      stream.Run(500);
    }
    stream.Run(4'000'000);
    stream.ExpectDelivered(0, 499);
    EXPECT_GT(stream.receiver().counts().num_repaired, 10);
    EXPECT_EQ(stream.receiver().counts().num_lost, 0);
  }
}

TEST(Stream, AGoodNetworkNeedsNoRequests) {
  Simulation stream(1, {});
  stream.Join();
  for (int i = 0; i < 300; ++i) {
    stream.Publish();
    stream.Run(1000);
  }
  stream.ExpectDelivered(0, 299);
  EXPECT_EQ(stream.num_requests(), 0);
}

// The last message has nothing behind it that would show the gap: the heartbeat does.
TEST(Stream, ALostTailIsFound) {
  Simulation stream(2, {.loss = 0.5});
  stream.Join();
  for (int i = 0; i < 10; ++i) stream.Publish();
  stream.Run(3'000'000);
  stream.ExpectDelivered(0, 9);
}

TEST(Stream, WhoComesLateGetsEverythingThatIsKept) {
  Simulation stream(3, {.loss = 0.05});
  for (int i = 0; i < 1000; ++i) {
    stream.Publish();
    stream.Run(100);
  }
  stream.Join();
  for (int i = 0; i < 100; ++i) {
    stream.Publish();
    stream.Run(1000);
  }
  stream.Run(3'000'000);
  stream.ExpectDelivered(0, 1099);
}

TEST(Stream, WhoComesLateBeginsWithTheFirstThatIsKept) {
  Simulation stream(4, {}, {}, 8 * 100);
  for (int i = 0; i < 250; ++i) stream.Publish();
  stream.Run(10'000);
  stream.Join();
  stream.Run(1'000'000);
  stream.ExpectDelivered(150, 249);
  EXPECT_EQ(stream.receiver().counts().num_lost, 0);
}

TEST(Stream, WhoWantsNewsOnlyBeginsNow) {
  Simulation stream(5, {}, {.starts_now = true});
  for (int i = 0; i < 50; ++i) stream.Publish();
  stream.Run(10'000);
  stream.Join();
  stream.Run(300'000);
  for (int i = 0; i < 20; ++i) stream.Publish();
  stream.Run(100'000);
  stream.ExpectDelivered(50, 69);
}

// What left the publisher's history is lost at once, counted, and the stream goes on behind it.
TEST(Stream, WhatIsNoLongerKeptIsLostAndCounted) {
  std::vector<int64_t> delivered;
  std::vector<int64_t> lost;
  StreamReceiver receiver(
      {}, {.deliver = [&](ByteView, const MessageHeader& header, int64_t) { delivered.push_back(header.sequence); },
           .lose = [&](int64_t num_messages) { lost.push_back(num_messages); }});
  const auto receive = [&](int64_t sequence, int64_t now_us) {
    receiver.OnMessage({.publisher = "p", .epoch_us = 1, .sequence = sequence}, MessageOf(sequence), 0, now_us);
  };
  receive(0, 0);
  receive(20, 100);
  receiver.OnHeartbeat(15, 21, 200);
  const auto ranges = receiver.Poll(200'000);
  EXPECT_EQ(lost, std::vector<int64_t>{14});
  ASSERT_EQ(ranges, (std::vector<SequenceRange>{{15, 19}}));
  for (int64_t i = 15; i < 20; ++i) receive(i, 300);
  EXPECT_EQ(delivered, (std::vector<int64_t>{0, 15, 16, 17, 18, 19, 20}));
  EXPECT_EQ(receiver.counts().num_lost, 14);
  EXPECT_EQ(receiver.counts().num_repaired, 5);
}

TEST(Stream, AGapThatNobodyFillsIsGivenUpAfterAWhile) {
  std::vector<int64_t> delivered;
  StreamReceiver receiver(
      {}, {.deliver = [&](ByteView, const MessageHeader& header, int64_t) { delivered.push_back(header.sequence); },
           .lose = [](int64_t) {}});
  const auto receive = [&](int64_t sequence, int64_t now_us) {
    receiver.OnMessage({.publisher = "p", .epoch_us = 1, .sequence = sequence}, MessageOf(sequence), 0, now_us);
  };
  receive(0, 0);
  receive(3, 0);
  int64_t now_us = 0;
  int num_requests = 0;
  for (; delivered.size() < 2 && now_us < 10'000'000; now_us += 1000) {
    if (now_us % kHeartbeatUs == 0) receiver.OnHeartbeat(0, 4, now_us);
    num_requests += receiver.Poll(now_us).empty() ? 0 : 1;
  }
  EXPECT_NEAR(static_cast<double>(now_us), 3e6, 0.2e6);
  EXPECT_EQ(delivered, (std::vector<int64_t>{0, 3}));
  EXPECT_EQ(receiver.counts().num_lost, 2);
  EXPECT_LE(num_requests, 15);  // at doubled intervals
  EXPECT_GE(num_requests, 8);
}

// A publisher in a long step answers late; that is no reason to lose anything.
TEST(Stream, ASilentPublisherIsWaitedForLonger) {
  std::vector<int64_t> delivered;
  StreamReceiver receiver(
      {}, {.deliver = [&](ByteView, const MessageHeader& header, int64_t) { delivered.push_back(header.sequence); },
           .lose = [](int64_t) {}});
  receiver.OnHeartbeat(0, 0, 0);
  receiver.OnMessage({.publisher = "p", .epoch_us = 1, .sequence = 1}, MessageOf(1), 0, 1000);
  for (int64_t now_us = 1000; now_us < 20'000'000; now_us += 10'000) (void)receiver.Poll(now_us);
  EXPECT_TRUE(delivered.empty());
  receiver.OnMessage({.publisher = "p", .epoch_us = 1, .sequence = 0}, MessageOf(0), 0, 20'000'000);
  EXPECT_EQ(delivered, (std::vector<int64_t>{0, 1}));
}

// lcm-logplayer sends no heartbeats and answers no requests.
TEST(Stream, AReplayedLogIsTakenAsItComes) {
  Simulation stream(7, {.loss = 0.1, .max_delay_us = 500});
  stream.StopPublisher();
  for (int i = 0; i < 5; ++i) stream.Publish();
  stream.Run(10'000);
  stream.Join();  // in the middle of it
  for (int i = 5; i < 400; ++i) {
    stream.Publish();
    stream.Run(50'000);
  }
  stream.Run(1'000'000);
  ASSERT_GT(stream.delivered().size(), 300U);
  EXPECT_TRUE(std::is_sorted(stream.delivered().begin(), stream.delivered().end()));
  EXPECT_LE(stream.delivered().front(), 8);
  EXPECT_EQ(stream.num_requests(), 0);
  EXPECT_EQ(stream.receiver().counts().num_lost, stream.delivered().back() - stream.delivered().front() + 1 -
                                                     static_cast<int64_t>(stream.delivered().size()));
}

TEST(Stream, NumbersThatCantBeTrueAreRefused) {
  int num_delivered = 0;
  StreamReceiver receiver(
      {}, {.deliver = [&](ByteView, const MessageHeader&, int64_t) { ++num_delivered; }, .lose = [](int64_t) {}});
  const auto receive = [&](int64_t sequence) {
    return receiver.OnMessage({.publisher = "p", .epoch_us = 1, .sequence = sequence}, MessageOf(0), 0, 0);
  };
  EXPECT_TRUE(receive(0));
  EXPECT_FALSE(receive(int64_t{1} << 50));
  receiver.OnHeartbeat(0, int64_t{1} << 50, 0);
  EXPECT_TRUE(receiver.Poll(100'000'000).empty());
  EXPECT_TRUE(receive(1));
  EXPECT_EQ(num_delivered, 2);
  EXPECT_EQ(receiver.counts().num_lost, 0);
}

// What waits behind a gap is bounded; what was dropped for that is asked for again.
TEST(Stream, WaitingMessagesAreBounded) {
  Simulation stream(8, {.loss = 0.3, .max_delay_us = 2000}, {.max_waiting_bytes = 8 * 20});
  stream.Join();
  for (int i = 0; i < 2000; ++i) stream.Publish();
  stream.Run(30'000'000);
  stream.ExpectDelivered(0, 1999);
}

}  // namespace
}  // namespace tessera
