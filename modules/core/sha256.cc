#include "core/sha256.h"

#include <glib.h>

#include <array>
#include <bit>

namespace tessera {

Sha256::Sha256() : checksum_(g_checksum_new(G_CHECKSUM_SHA256)) {}

Sha256::~Sha256() { g_checksum_free(checksum_); }

void Sha256::Add(const void* bytes, size_t num_bytes) {
  g_checksum_update(checksum_, static_cast<const guchar*>(bytes), static_cast<gssize>(num_bytes));
}

void Sha256::Add(int64_t value) {
  std::array<uint8_t, 8> bytes;
  for (size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<uint8_t>(static_cast<uint64_t>(value) >> (8 * i));
  }
  Add(bytes.data(), bytes.size());
}

void Sha256::Add(double value) { Add(std::bit_cast<int64_t>(value)); }

std::string Sha256::HexDigest() const {
  GChecksum* copy = g_checksum_copy(checksum_);
  std::string digest = g_checksum_get_string(copy);
  g_checksum_free(copy);
  return digest;
}

}  // namespace tessera
