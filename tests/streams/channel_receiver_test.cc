// The streams of all publishers of one channel.
#include "streams/channel_receiver.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace tessera {
namespace {

const Bytes kMessage(8);

TEST(Channel, ARestartedPublisherBeginsANewStream) {
  std::vector<std::pair<int64_t, int64_t>> delivered;  // epoch, number
  std::vector<int64_t> lost;
  ChannelReceiver channel("POSE", {},
                          {.deliver = [&](ByteView, const MessageHeader& header,
                                          int64_t) { delivered.emplace_back(header.epoch_us, header.sequence); },
                           .lose =
                               [&](const std::string& publisher, int64_t num_messages) {
                                 EXPECT_EQ(publisher, "tracker");
                                 lost.push_back(num_messages);
                               }});
  const auto receive = [&](int64_t epoch_us, int64_t sequence) {
    return channel.OnMessage({.publisher = "tracker", .epoch_us = epoch_us, .sequence = sequence}, kMessage, 0, 0);
  };
  receive(100, 0);
  receive(100, 2);  // 1 is missing when the publisher dies
  receive(200, 0);
  EXPECT_TRUE(receive(100, 1));  // a straggler
  receive(200, 1);
  EXPECT_EQ(delivered, (std::vector<std::pair<int64_t, int64_t>>{{100, 0}, {100, 2}, {200, 0}, {200, 1}}));
  EXPECT_EQ(lost, (std::vector<int64_t>{1, 0}));
  EXPECT_EQ(channel.counts().num_lost, 1);
}

TEST(Channel, WhatWaitsBehindAGapCanBeLeftToTheSuccessor) {
  std::vector<std::pair<int64_t, int64_t>> delivered;  // epoch, number
  ChannelReceiver channel("FEATURES", {.discards_at_restart = true},
                          {.deliver = [&](ByteView, const MessageHeader& header,
                                          int64_t) { delivered.emplace_back(header.epoch_us, header.sequence); },
                           .lose = [](const std::string&, int64_t num_messages) { EXPECT_EQ(num_messages, 0); }});
  for (const auto& [epoch_us, sequence] : {std::pair(100, 0), std::pair(100, 2), std::pair(200, 0)}) {
    channel.OnMessage({.publisher = "reassembler", .epoch_us = epoch_us, .sequence = sequence}, kMessage, 0, 0);
  }
  EXPECT_EQ(delivered, (std::vector<std::pair<int64_t, int64_t>>{{100, 0}, {200, 0}}));
  EXPECT_EQ(channel.counts().num_lost, 0);
}

TEST(Channel, PublishersDoNotWaitForEachOther) {
  std::vector<std::string> delivered;
  ChannelReceiver channel(
      "TILE_FEATURES", {},
      {.deliver = [&](ByteView, const MessageHeader& header, int64_t) { delivered.push_back(header.publisher); },
       .lose = [](const std::string&, int64_t) {}});
  channel.OnMessage({.publisher = "extractor_0", .epoch_us = 1, .sequence = 0}, kMessage, 0, 0);
  channel.OnMessage({.publisher = "extractor_0", .epoch_us = 1, .sequence = 2}, kMessage, 0, 0);
  channel.OnMessage({.publisher = "extractor_1", .epoch_us = 2, .sequence = 0}, kMessage, 0, 0);
  EXPECT_EQ(delivered, (std::vector<std::string>{"extractor_0", "extractor_1"}));
  channel.OnHeartbeat("extractor_0",
                      {.channel = "TILE_FEATURES", .epoch_us = 1, .first_sequence = 0, .next_sequence = 3}, 0);
  const auto requests = channel.Poll(20'000);
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_EQ(requests[0],
            (RepairRequest{.channel = "TILE_FEATURES", .publisher = "extractor_0", .epoch_us = 1, .ranges = {{1, 1}}}));
}

// The end of a recording: what waits behind a gap is given on, and the gap is counted.
TEST(Channel, AbandoningGivesOnWhatIsThere) {
  std::vector<int64_t> delivered;
  int64_t num_lost = 0;
  ChannelReceiver channel(
      "CAMERA", {},
      {.deliver = [&](ByteView, const MessageHeader& header, int64_t) { delivered.push_back(header.sequence); },
       .lose = [&](const std::string&, int64_t num_messages) { num_lost += num_messages; }});
  for (const int64_t sequence : {0, 3, 5}) {
    channel.OnMessage({.publisher = "camera", .epoch_us = 1, .sequence = sequence}, kMessage, 0, 0);
  }
  EXPECT_EQ(delivered, (std::vector<int64_t>{0}));
  channel.Abandon();
  EXPECT_EQ(delivered, (std::vector<int64_t>{0, 3, 5}));
  EXPECT_EQ(num_lost, 3);
  EXPECT_EQ(channel.counts().num_lost, 3);
}

}  // namespace
}  // namespace tessera
