#include "wire/codec_impl.h"

namespace tessera {
namespace {

constexpr int64_t kMaxTimeUs = int64_t{1} << 56;  // year 4253
constexpr int64_t kMaxSequence = int64_t{1} << 53;
constexpr int32_t kMaxParts = 1 << 20;
constexpr size_t kMaxNameLength = 63;

}  // namespace

void SetHeader(const MessageHeader& header, header_t* message_header) {
  message_header->publisher = header.publisher;
  message_header->epoch_us = header.epoch_us;
  message_header->sequence = header.sequence;
  message_header->utime = header.publish_us;
  message_header->part = header.part;
  message_header->num_parts = header.num_parts;
}

void PatchNumParts(const std::string& publisher, int32_t num_parts, Bytes* message) {
  // Fingerprint, tag, publisher (length, text, zero), epoch, sequence, utime (8 each), part (4), num_parts.
  uint8_t* at = message->data() + kTagOffset + kTagBytes + 4 + publisher.size() + 1 + 3 * 8 + 4;
  for (int shift = 24; shift >= 0; shift -= 8) {
    *at++ = static_cast<uint8_t>(static_cast<uint32_t>(num_parts) >> shift);
  }
}

std::optional<MessageHeader> ReadHeader(ByteView message) {
  const WireType* type = WireType::Of(message);
  return type != nullptr && type->Matches(message) ? ReadHeaderOfFront(message) : std::nullopt;
}

std::optional<MessageHeader> ReadHeaderOfFront(ByteView message) {
  if (WireType::Of(message) == nullptr) return std::nullopt;
  header_t header;
  // Every type that is sent begins with its header; decoding one that doesn't gives nonsense, but stays in bounds.
  if (!WireType::Named("header_t").MatchesFront(message.subspan(8)) ||
      header._decodeNoHash(message.data(), 8, static_cast<int>(message.size()) - 8) < 0) {
    return std::nullopt;
  }
  const bool in_range = !header.publisher.empty() && header.publisher.size() <= kMaxNameLength && header.epoch_us > 0 &&
                        header.epoch_us < kMaxTimeUs && header.sequence >= 0 && header.sequence < kMaxSequence &&
                        header.num_parts >= 1 && header.num_parts <= kMaxParts && header.part >= 0 &&
                        header.part < header.num_parts && header.part <= header.sequence &&
                        header.utime > -kMaxTimeUs && header.utime < kMaxTimeUs;
  if (!in_range) {
    return std::nullopt;
  }
  return MessageHeader{header.publisher, header.epoch_us, header.sequence, header.utime, header.part, header.num_parts};
}

}  // namespace tessera
