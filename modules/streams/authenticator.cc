#include "streams/authenticator.h"

// SHA256_Init and its like: EVP's digests allocate memory anew for each message.
#define OPENSSL_SUPPRESS_DEPRECATED
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/sha.h>

#include <algorithm>
#include <stdexcept>

namespace tessera {
namespace {

constexpr size_t kSignedOffset = kTagOffset + kTagBytes;
constexpr size_t kHeaderBytes = 128;  // behind the tag, the rest of the longest header is within these
constexpr size_t kNonceBytes = 12;

void Require(int succeeded) {
  if (succeeded != 1) throw std::runtime_error("OpenSSL can't compute the tag of a message");
}

}  // namespace

struct Authenticator::Cipher {
  struct Free {
    void operator()(EVP_CIPHER_CTX* context) const { EVP_CIPHER_CTX_free(context); }
  };
  std::unique_ptr<EVP_CIPHER_CTX, Free> cipher{EVP_CIPHER_CTX_new()};
};

Authenticator::Authenticator(const Secret& secret) : cipher_(std::make_unique<Cipher>()) {
  Require(cipher_->cipher ? 1 : 0);
  Require(EVP_EncryptInit_ex(cipher_->cipher.get(), EVP_chacha20_poly1305(), nullptr, secret.data(), nullptr));
}

Authenticator::~Authenticator() = default;

Authenticator::Tag Authenticator::TagOf(const std::string& channel, ByteView message) const {
  const ByteView content = message.subspan(kSignedOffset);
  std::array<uint8_t, SHA256_DIGEST_LENGTH> nonce;
  SHA256_CTX digest;
  Require(SHA256_Init(&digest));
  Require(SHA256_Update(&digest, channel.c_str(), channel.size() + 1));
  Require(SHA256_Update(&digest, message.data(), kTagOffset));
  Require(SHA256_Update(&digest, content.data(), std::min(content.size(), kHeaderBytes)));
  Require(SHA256_Final(nonce.data(), &digest));

  EVP_CIPHER_CTX* cipher = cipher_->cipher.get();
  Tag tag;
  int num_written = 0;
  Require(EVP_EncryptInit_ex(cipher, nullptr, nullptr, nullptr, nonce.data()));
  Require(EVP_EncryptUpdate(cipher, nullptr, &num_written, content.data(), static_cast<int>(content.size())));
  Require(EVP_EncryptFinal_ex(cipher, nonce.data() + kNonceBytes, &num_written));
  Require(EVP_CIPHER_CTX_ctrl(cipher, EVP_CTRL_AEAD_GET_TAG, static_cast<int>(kTagBytes), tag.data()));
  return tag;
}

void Authenticator::Sign(const std::string& channel, Bytes* message) const {
  const Tag tag = TagOf(channel, *message);
  std::copy(tag.begin(), tag.end(), message->begin() + kTagOffset);
}

bool Authenticator::Verify(const std::string& channel, ByteView message) const {
  if (message.size() < kSignedOffset) return false;
  const Tag tag = TagOf(channel, message);
  return CRYPTO_memcmp(tag.data(), message.data() + kTagOffset, kTagBytes) == 0;
}

}  // namespace tessera
