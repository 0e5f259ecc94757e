// A map from ids to values for ids that are handed out by counting: looking up is two indexings, walking is in the
// order of ids, and values lie side by side in chunks. They never move while they are in the map, and what a removed
// one leaves is used again; of a stretch of 64 ids that are all removed, eight bytes stay.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace tessera {

template <class Key, class Value>
class IdMap {
 public:
  IdMap() = default;
  IdMap(const IdMap& other) : pages_(other.pages_.size()), end_id_(other.end_id_) {
    other.ForEach([this](Key key, const Value& value) { Put(key, value); });
  }
  IdMap(IdMap&& other) noexcept { Swap(other); }
  IdMap& operator=(IdMap other) noexcept {
    Swap(other);
    return *this;
  }
  ~IdMap() = default;

  // Null if there is no such id.
  const Value* Find(Key key) const { return SlotValue(key); }
  Value* Find(Key key) { return SlotValue(key); }
  bool Has(Key key) const { return Find(key) != nullptr; }
  // The key must be valid; an old value is replaced.
  Value& Put(Key key, Value value) {
    Page& page = PageFor(key);
    Value*& slot = page.slots[SlotOf(key)];
    if (slot == nullptr) {
      slot = TakeFree();
      ++page.num_values;
    }
    *slot = std::move(value);
    return *slot;
  }
  void Remove(Key key) {
    Value* value = Find(key);
    if (value == nullptr) return;
    *value = Value{};
    free_.push_back(value);
    std::unique_ptr<Page>& page = pages_[PageOf(key)];
    page->slots[SlotOf(key)] = nullptr;
    if (--page->num_values == 0) page.reset();
  }
  int64_t size() const { return static_cast<int64_t>(chunks_.size() * kChunk - free_.size()); }
  // Ids below were given out, also such as were never put here.
  void RaiseEnd(int64_t end_id) { end_id_ = std::max(end_id_, end_id); }
  // One more than the highest id that was ever put.
  int64_t end_id() const { return end_id_; }

  // Calls visit(key, value) in the order of ids.
  template <class Visit>
  void ForEach(Visit visit) const {
    for (size_t p = 0; p < pages_.size(); ++p) {
      for (size_t s = 0; pages_[p] != nullptr && s < kPage; ++s) {
        const Value* value = pages_[p]->slots[s];
        if (value != nullptr) visit(Key{static_cast<int64_t>(p * kPage + s)}, *value);
      }
    }
  }

 private:
  static constexpr size_t kPage = 64;   // ids
  static constexpr size_t kChunk = 64;  // values

  struct Page {
    std::array<Value*, kPage> slots{};  // by id; null: no such id
    size_t num_values = 0;
  };

  static size_t PageOf(Key key) { return static_cast<size_t>(key.value) / kPage; }
  static size_t SlotOf(Key key) { return static_cast<size_t>(key.value) % kPage; }

  Value* SlotValue(Key key) const {
    if (!key.valid() || PageOf(key) >= pages_.size()) return nullptr;
    const Page* page = pages_[PageOf(key)].get();
    return page == nullptr ? nullptr : page->slots[SlotOf(key)];
  }
  Page& PageFor(Key key) {
    end_id_ = std::max(end_id_, key.value + 1);
    if (PageOf(key) >= pages_.size()) pages_.resize(PageOf(key) + 1);
    std::unique_ptr<Page>& page = pages_[PageOf(key)];
    if (page == nullptr) page = std::make_unique<Page>();
    return *page;
  }
  Value* TakeFree() {
    if (free_.empty()) {
      auto& chunk = *chunks_.emplace_back(std::make_unique<std::array<Value, kChunk>>());
      for (size_t i = kChunk; i-- > 0;) free_.push_back(&chunk[i]);
    }
    Value* value = free_.back();
    free_.pop_back();
    return value;
  }
  void Swap(IdMap& other) noexcept {
    std::swap(pages_, other.pages_);
    std::swap(end_id_, other.end_id_);
    std::swap(chunks_, other.chunks_);
    std::swap(free_, other.free_);
  }

  std::vector<std::unique_ptr<Page>> pages_;  // by id; null: none of its ids
  int64_t end_id_ = 0;
  std::vector<std::unique_ptr<std::array<Value, kChunk>>> chunks_;
  std::vector<Value*> free_;  // of the chunks; the last one is taken next
};

}  // namespace tessera
