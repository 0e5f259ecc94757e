#include "fuzz/mutations.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace tessera {
namespace {

constexpr size_t kMaxBytes = 8192;
constexpr size_t kMaxRange = 64;
// Where counts, lengths and indices go wrong.
constexpr std::array<int64_t, 16> kNumbers{0,
                                           1,
                                           -1,
                                           2,
                                           127,
                                           128,
                                           255,
                                           256,
                                           32'767,
                                           65'536,
                                           1 << 20,
                                           std::numeric_limits<int32_t>::max(),
                                           std::numeric_limits<int32_t>::min(),
                                           int64_t{1} << 32,
                                           std::numeric_limits<int64_t>::max(),
                                           std::numeric_limits<int64_t>::min()};
const std::array<std::string, 10> kWords{"0",   "-1", "nan", "1e999", "99999999999999999999",
                                         "inf", "\n", ",",   "-",     std::string(1, '\0')};

}  // namespace

size_t Mutations::Draw(size_t end) { return end == 0 ? 0 : generator_() % end; }

std::string Mutations::Next() {
  std::string text = inputs_[Draw(inputs_.size())];
  for (size_t left = 1 + Draw(5); left > 0; --left) Change(&text);
  if (text.size() > kMaxBytes) text.resize(kMaxBytes);
  return text;
}

void Mutations::Change(std::string* text) {
  const size_t at = Draw(text->size() + 1);
  const size_t length = 1 + Draw(std::min(kMaxRange, text->size() - at));
  switch (Draw(8)) {
    case 0:  // a bit
      if (at < text->size()) (*text)[at] = static_cast<char>((*text)[at] ^ (1 << Draw(8)));
      break;
    case 1:
      if (at < text->size()) (*text)[at] = static_cast<char>(generator_());
      break;
    case 2: {  // a number of 1, 2, 4 or 8 bytes, most significant byte first
      const auto number = static_cast<uint64_t>(kNumbers[Draw(kNumbers.size())]);
      const size_t size = size_t{1} << Draw(4);
      for (size_t i = 0; i < size && at + i < text->size(); ++i) {
        (*text)[at + i] = static_cast<char>(number >> (8 * (size - 1 - i)));
      }
      break;
    }
    case 3:
      text->erase(at, length);
      break;
    case 4:
      text->insert(at, text->substr(at, length));
      break;
    case 5: {  // a part of another input
      const std::string& other = inputs_[Draw(inputs_.size())];
      const size_t from = Draw(other.size());
      text->replace(at, Draw(2) == 0 ? 0 : length, other.substr(from, 1 + Draw(other.size() - from)));
      break;
    }
    case 6:
      text->replace(at, Draw(2) == 0 ? 0 : length, kWords[Draw(kWords.size())]);
      break;
    default:
      text->resize(at);
  }
}

}  // namespace tessera
