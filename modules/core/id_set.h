// A set of ids that are handed out by counting: one bit for each, so that adding and asking is one indexing, and
// walking is in the order of ids.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

template <class Key>
class IdSet {
 public:
  IdSet() = default;
  // Empty, with room for ids below `end_id`. Larger ones make room for themselves.
  explicit IdSet(int64_t end_id) : words_((static_cast<size_t>(end_id) + kBits - 1) / kBits) {}

  // The key must be valid. False if it was there already.
  bool Add(Key key) {
    const size_t word = WordOf(key);
    if (word >= words_.size()) words_.resize(word + 1);
    const bool is_new = (words_[word] & BitOf(key)) == 0;
    words_[word] |= BitOf(key);
    return is_new;
  }
  // False if it was not there.
  bool Remove(Key key) {
    const bool was_there = Has(key);
    if (was_there) words_[WordOf(key)] &= ~BitOf(key);
    return was_there;
  }
  bool Has(Key key) const {
    return key.valid() && WordOf(key) < words_.size() && (words_[WordOf(key)] & BitOf(key)) != 0;
  }

  // Calls visit(key) in the order of ids.
  template <class Visit>
  void ForEach(Visit visit) const {
    for (size_t word = 0; word < words_.size(); ++word) {
      for (uint64_t left = words_[word]; left != 0; left &= left - 1) {
        visit(Key{static_cast<int64_t>(word * kBits) + std::countr_zero(left)});
      }
    }
  }
  // All of them, in order.
  std::vector<Key> Ids() const {
    size_t num_ids = 0;
    for (const uint64_t word : words_) num_ids += static_cast<size_t>(std::popcount(word));
    std::vector<Key> ids;
    ids.reserve(num_ids);
    ForEach([&](Key key) { ids.push_back(key); });
    return ids;
  }

 private:
  static constexpr size_t kBits = 64;  // of a word

  static size_t WordOf(Key key) { return static_cast<size_t>(key.value) / kBits; }
  static uint64_t BitOf(Key key) { return uint64_t{1} << (static_cast<size_t>(key.value) % kBits); }

  std::vector<uint64_t> words_;
};

}  // namespace tessera
