#include "core/crc32.h"

#include <libdeflate.h>

namespace tessera {

uint32_t Crc32(std::span<const uint8_t> bytes, uint32_t before) {
  if (bytes.empty()) return before;  // libdeflate begins anew where there is no address
  return libdeflate_crc32(before, bytes.data(), bytes.size());
}

}  // namespace tessera
