// The walk over received bytes knows the types exactly as lcm-gen does.
#include "wire/wire_type.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "support/example_values.h"
#include "tessera/calibration_t.hpp"
#include "tessera/camera_image_t.hpp"
#include "tessera/end_of_stream_t.hpp"
#include "tessera/extractor_ready_t.hpp"
#include "tessera/features_t.hpp"
#include "tessera/ground_truth_t.hpp"
#include "tessera/heartbeat_t.hpp"
#include "tessera/keyframe_t.hpp"
#include "tessera/pose_t.hpp"
#include "tessera/repair_request_t.hpp"
#include "tessera/stage_status_t.hpp"
#include "tessera/tile_ack_t.hpp"
#include "tessera/tile_features_t.hpp"
#include "tessera/tile_job_t.hpp"

namespace tessera {
namespace {

template <class Message>
void ExpectSameFingerprint() {
  EXPECT_EQ(WireType::Named(Message::getTypeName()).fingerprint(), Message::getHash()) << Message::getTypeName();
}

TEST(WireType, FingerprintsAreThoseOfLcmGen) {
  ExpectSameFingerprint<header_t>();
  ExpectSameFingerprint<camera_image_t>();
  ExpectSameFingerprint<calibration_t>();
  ExpectSameFingerprint<ground_truth_t>();
  ExpectSameFingerprint<end_of_stream_t>();
  ExpectSameFingerprint<tile_job_t>();
  ExpectSameFingerprint<tile_features_t>();
  ExpectSameFingerprint<features_t>();
  ExpectSameFingerprint<extractor_ready_t>();
  ExpectSameFingerprint<tile_ack_t>();
  ExpectSameFingerprint<pose_t>();
  ExpectSameFingerprint<keyframe_t>();
  ExpectSameFingerprint<stage_status_t>();
  ExpectSameFingerprint<heartbeat_t>();
  ExpectSameFingerprint<repair_request_t>();
  EXPECT_THROW(WireType::Named("nothing_t"), std::logic_error);
}

struct ExactFit {
  template <class Value>
  void operator()() const {
    SCOPED_TRACE(TypeName<Value>());
    std::mt19937 generator(1);
    for (Bytes message : EncodeValue(DrawValue<Value>(generator, 1), ExampleHeader(), 2000)) {
      const WireType* type = WireType::Of(message);
      ASSERT_NE(type, nullptr);
      EXPECT_EQ(type->name(), TypeName<Value>());
      EXPECT_TRUE(type->Matches(message));
      message.push_back(0);
      EXPECT_FALSE(type->Matches(message));  // something behind
      message.pop_back();
      for (int i = 0; i < 20 && !message.empty(); ++i) {
        message.resize(generator() % message.size());
        EXPECT_FALSE(type->Matches(message));  // cut
      }
    }
  }
};

TEST(WireType, OnlyWholeMessagesMatch) { ForEachValueType(ExactFit()); }

// The count of a tile_ack_t stands before its tiles, 4 + 4 num_tiles bytes, and what follows them: 1 + 4 bytes.
Bytes AckWithCount(uint32_t count) {
  Bytes message = EncodeValue(TileAck{.frame = {1}, .tiles = {5, 6}}, ExampleHeader(), 2000)[0];
  for (size_t i = 0; i < 4; ++i) message[message.size() - 17 + i] = static_cast<uint8_t>(count >> (24 - 8 * i));
  return message;
}

TEST(WireType, LengthsOfArraysAreNotBelieved) {
  const WireType& type = WireType::Named("tile_ack_t");
  EXPECT_TRUE(type.Matches(AckWithCount(2)));
  for (const uint32_t count : {0U, 1U, 3U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU, 0x40000002U}) {
    EXPECT_FALSE(type.Matches(AckWithCount(count))) << count;
    EXPECT_FALSE(ReadHeader(AckWithCount(count))) << count;
  }
}

TEST(WireType, TextsMustEndAndHaveNoControlCharacters) {
  const Bytes message = EncodeValue(EndOfStream{.stage = StageKind::kCamera}, ExampleHeader(), 2000)[0];
  EXPECT_TRUE(ReadHeader(message));
  Bytes with_escape = message;
  *std::search(with_escape.begin(), with_escape.end(), "camera", "camera" + 6) = 0x1B;
  EXPECT_FALSE(ReadHeader(with_escape));
  Bytes unterminated = message;
  *(std::search(unterminated.begin(), unterminated.end(), "camera", "camera" + 6) + 6) = 'x';
  EXPECT_FALSE(ReadHeader(unterminated));
}

}  // namespace
}  // namespace tessera
