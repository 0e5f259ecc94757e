// SHA-256 (glib's) over the exact bits of values, for `trajectory_sha256` and `map_sha256`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

struct _GChecksum;

namespace tessera {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Add(const void* bytes, size_t num_bytes);
  // The eight bytes of the value, least significant first, whatever the machine.
  void Add(int64_t value);
  void Add(double value);

  // 64 hexadecimal digits of everything added so far; adding may go on.
  std::string HexDigest() const;

 private:
  _GChecksum* checksum_;
};

}  // namespace tessera
