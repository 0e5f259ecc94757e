// What a member of the run sent is told from everything else.
#include "streams/authenticator.h"

#include <gtest/gtest.h>

#include <numeric>
#include <string>

#include "messages/tracking_types.h"

namespace tessera {
namespace {

Authenticator::Secret MakeSecret(uint8_t first) {
  Authenticator::Secret secret;
  std::iota(secret.begin(), secret.end(), first);
  return secret;
}

const Authenticator& Member() {
  static const Authenticator member(MakeSecret(0));
  return member;
}

Bytes SignedPose(const MessageHeader& header) {
  Bytes message = EncodeValue(PoseEstimate{.frame = {7}}, header, 60000).front();
  Member().Sign("a_POSE", &message);
  return message;
}

const MessageHeader kHeader{.publisher = "tracker", .epoch_us = 1000, .sequence = 5, .publish_us = 2000};

TEST(Authenticator, MembersKnowEachOther) {
  const Authenticator other_member(MakeSecret(0));
  const Bytes message = SignedPose(kHeader);
  EXPECT_TRUE(other_member.Verify("a_POSE", message));
  EXPECT_EQ(message, SignedPose(kHeader)) << "what is sent again has the same tag";
  ASSERT_TRUE(ReadHeader(message).has_value());
  EXPECT_EQ(ReadHeader(message)->sequence, 5);
}

TEST(Authenticator, AnotherSecretIsAStrangers) {
  EXPECT_FALSE(Authenticator(MakeSecret(1)).Verify("a_POSE", SignedPose(kHeader)));
}

TEST(Authenticator, AMessageCantBeMovedToAnotherChannel) {
  for (const std::string channel : {"POSE", "b_POSE", "a_KEYFRAME", "a_POS", "", "a_POSE "}) {
    EXPECT_FALSE(Member().Verify(channel, SignedPose(kHeader))) << channel;
  }
}

TEST(Authenticator, EveryChangedBitIsNoticed) {
  const Bytes message = SignedPose(kHeader);
  for (size_t i = 0; i < 8 * message.size(); ++i) {
    Bytes changed = message;
    changed[i / 8] = static_cast<uint8_t>(changed[i / 8] ^ (1 << i % 8));
    EXPECT_FALSE(Member().Verify("a_POSE", changed)) << "bit " << i;
  }
}

TEST(Authenticator, BytesOfAnyLengthAreBytesOfAStranger) {
  const Bytes message = SignedPose(kHeader);
  for (size_t size = 0; size < message.size(); ++size) {
    EXPECT_FALSE(Member().Verify("a_POSE", ByteView(message).first(size))) << size;
  }
  Bytes longer = message;
  longer.push_back(0);
  EXPECT_FALSE(Member().Verify("a_POSE", longer));
}

TEST(Authenticator, TheLongestHeaderIsWithinWhatMakesTheNonce) {
  MessageHeader header = kHeader;
  header.publisher = std::string(63, 'p');
  const Bytes message = SignedPose(header);
  header.sequence += 1;
  // As long as two messages differ in their headers, what separates them is no forgery of either.
  EXPECT_NE(message, SignedPose(header));
  EXPECT_LE(4 + 64 + 3 * 8 + 2 * 4, 128);
}

// The same numbers stand in tests/procman/membership_test.py, whose tags are made by libsodium.
TEST(Authenticator, ThePythonSideMakesTheSameTag) {
  Bytes message(300);
  std::iota(message.begin(), message.end(), uint8_t{0});
  Member().Sign("POSE", &message);
  std::string hex;
  for (size_t i = kTagOffset; i < kTagOffset + kTagBytes; ++i) {
    constexpr char kDigits[] = "0123456789abcdef";
    hex += kDigits[message[i] >> 4];
    hex += kDigits[message[i] & 15];
  }
  EXPECT_EQ(hex, "ba35314392b631b687cd82433601b3fb");
}

}  // namespace
}  // namespace tessera
