// Tells what a member of the run sent from what a stranger sent. Members share a secret, and each message carries a tag
// that takes the secret to make:
//
//   nonce = SHA-256(channel, 0, type and header of the message)[0:12]
//   tag   = ChaCha20-Poly1305(secret, nonce), RFC 8439, of no text, with the whole message behind its tag as
//           additional data
//
// The header names publisher, epoch, sequence number and part, so that no two messages of a run share a nonce, and none
// can take another's place in its stream or on another channel. A message that is sent once more keeps its tag: order
// and repetition are for the streams to judge. The same bits are made by libsodium, which Python uses.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "wire/bytes.h"
#include "wire/codec.h"

namespace tessera {

class Authenticator {
 public:
  using Secret = std::array<uint8_t, 32>;
  explicit Authenticator(const Secret& secret);
  ~Authenticator();

  // Fills in the tag of an encoded message. `channel`: with prefix.
  void Sign(const std::string& channel, Bytes* message) const;
  // Whether the tag is that of a member. Any bytes may be given.
  bool Verify(const std::string& channel, ByteView message) const;

 private:
  using Tag = std::array<uint8_t, kTagBytes>;
  Tag TagOf(const std::string& channel, ByteView message) const;

  struct Cipher;
  std::unique_ptr<Cipher> cipher_;
};

}  // namespace tessera
