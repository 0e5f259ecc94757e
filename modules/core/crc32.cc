#include "core/crc32.h"

#include <zlib.h>

namespace tessera {

uint32_t Crc32(std::span<const uint8_t> bytes, uint32_t before) {
  return static_cast<uint32_t>(crc32_z(before, bytes.data(), bytes.size()));
}

}  // namespace tessera
