#include "core/crc32.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace tessera {
namespace {

std::span<const uint8_t> BytesOf(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

TEST(Crc32, AgreesWithTheStandard) {
  EXPECT_EQ(Crc32({}), 0U);
  EXPECT_EQ(Crc32(BytesOf("123456789")), 0xCBF43926U);  // the check value of CRC-32/ISO-HDLC
}

TEST(Crc32, OfPartsIsThatOfTheWhole) {
  EXPECT_EQ(Crc32(BytesOf("6789"), Crc32(BytesOf("12345"))), Crc32(BytesOf("123456789")));
  EXPECT_EQ(Crc32({}, Crc32(BytesOf("12345"))), Crc32(BytesOf("12345")));
}

TEST(Crc32, SeesEveryBit) {
  std::vector<uint8_t> bytes(100, 7);
  const uint32_t whole = Crc32(bytes);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] ^= static_cast<uint8_t>(1U << (bit % 8));
    EXPECT_NE(Crc32(bytes), whole) << bit;
    bytes[bit / 8] ^= static_cast<uint8_t>(1U << (bit % 8));
  }
}

}  // namespace
}  // namespace tessera
