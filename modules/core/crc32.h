// CRC-32 as in zlib, PNG and IEEE 802.3, for finding bytes that were changed by accident.
#pragma once

#include <cstdint>
#include <span>

namespace tessera {

// Of `bytes` behind those with the checksum `before`: Crc32(b, Crc32(a)) is that of both together. 0: of none.
uint32_t Crc32(std::span<const uint8_t> bytes, uint32_t before = 0);

}  // namespace tessera
