// What a publisher keeps, and how often it sends it again.
#include "streams/stream_history.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(History, KeepsTheNewestAndAnswersOnceInAWhile) {
  const auto message_of = [](int64_t sequence) { return Bytes(8, static_cast<uint8_t>(sequence)); };
  StreamHistory history(20);
  for (int64_t i = 0; i < 5; ++i) history.Append(message_of(i));
  EXPECT_EQ(history.first(), 3);
  EXPECT_EQ(history.next(), 5);
  EXPECT_EQ(history.Resend(2, 0, 5000), nullptr);
  EXPECT_EQ(history.Resend(5, 0, 5000), nullptr);
  ASSERT_NE(history.Resend(3, 0, 5000), nullptr);
  EXPECT_EQ(history.Resend(3, 4999, 5000), nullptr);
  EXPECT_EQ(*history.Resend(3, 5000, 5000), message_of(3));
  history.Append(Bytes(1000));
  EXPECT_EQ(history.first(), 5);  // the newest is kept even if it alone is too large
}

TEST(History, WhatIsForgottenKeepsItsNumbers) {
  StreamHistory history(20);
  for (int i = 0; i < 3; ++i) history.Append(Bytes(8));
  history.Clear();
  EXPECT_EQ(history.first(), 3);
  EXPECT_EQ(history.next(), 3);
  EXPECT_EQ(history.Resend(2, 0, 5000), nullptr);
  history.Append(Bytes(8));
  history.Append(Bytes(8));
  EXPECT_EQ(history.first(), 3) << "what was forgotten takes no room";
  EXPECT_NE(history.Resend(3, 0, 5000), nullptr);
}

}  // namespace
}  // namespace tessera
