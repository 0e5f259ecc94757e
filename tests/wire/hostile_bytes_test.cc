// Random bytes, cut messages, flipped bits and false lengths on every channel: refused or decoded, never a crash.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "support/example_values.h"

namespace tessera {
namespace {

constexpr int kNumCases = 8000;  // by type; 176,000 in all

Bytes RandomBytes(std::mt19937& generator, size_t max_size) {
  Bytes bytes(generator() % max_size);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(generator());
  return bytes;
}

// One of many ways to spoil a message.
Bytes Spoil(Bytes message, std::mt19937& generator) {
  switch (generator() % 6) {
    case 0:  // nothing is left of it
      return RandomBytes(generator, 300);
    case 1: {  // the type is right, the rest is not
      const Bytes tail = RandomBytes(generator, 600);
      message.resize(8);
      message.insert(message.end(), tail.begin(), tail.end());
      return message;
    }
    case 2:  // cut
      message.resize(generator() % message.size());
      return message;
    case 3:  // longer than it should be
      message.resize(message.size() + 1 + generator() % 100, static_cast<uint8_t>(generator()));
      return message;
    case 4:  // some bits are flipped
      for (unsigned i = 0; i <= generator() % 8; ++i) {
        message[generator() % message.size()] ^= static_cast<uint8_t>(1U << (generator() % 8));
      }
      return message;
    default: {  // a field of four bytes, perhaps a length, is made extreme
      const size_t at = generator() % (message.size() - 3);
      const uint8_t value = std::array<uint8_t, 4>{0x00, 0x7F, 0x80, 0xFF}[generator() % 4];
      std::fill_n(message.begin() + static_cast<ptrdiff_t>(at), 4, value);
      return message;
    }
  }
}

struct Attack {
  template <class Value>
  void operator()() const {
    SCOPED_TRACE(TypeName<Value>());
    std::mt19937 generator(6);
    ValueJoiner<Value> joiner;
    std::vector<Bytes> messages;
    int num_refused = 0;
    for (int i = 0; i < kNumCases; ++i) {
      if (i % 50 == 0) messages = EncodeValue(DrawValue<Value>(generator, 1), ExampleHeader(), 4000);
      const Bytes message = Spoil(messages[generator() % messages.size()], generator);
      const auto header = ReadHeader(message);
      if (!header) {
        ++num_refused;
        continue;
      }
      if (const auto value = joiner.Add(message, *header); !value) {
        EXPECT_FALSE(value.error().sentence.empty());
        ++num_refused;
      }
      if (generator() % 2 == 0) (void)joiner.Add(messages[0], *ReadHeader(messages[0]));
    }
    EXPECT_GT(num_refused, kNumCases / 2);
  }
};

TEST(HostileBytes, EveryDecoderStands) { ForEachValueType(Attack()); }

// Messages of another type on a channel are refused.
TEST(HostileBytes, OtherTypesAreRefused) {
  const Bytes pose = EncodeValue(PoseEstimate{.frame = {1}}, ExampleHeader(), 4000)[0];
  ValueJoiner<EndOfStream> joiner;
  EXPECT_FALSE(joiner.Add(pose, *ReadHeader(pose)));
}

}  // namespace
}  // namespace tessera
