// A map from ids to values for ids that are handed out by counting: looking up is one indexing, walking is in the order
// of ids, and values lie side by side in chunks. They never move while they are in the map, and what a removed one
// leaves is used again; its id leaves a slot of eight bytes.
#pragma once

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
  IdMap(const IdMap& other) : slots_(other.slots_.size()) {
    other.ForEach([this](Key key, const Value& value) { Put(key, value); });
  }
  IdMap(IdMap&& other) noexcept { Swap(other); }
  IdMap& operator=(IdMap other) noexcept {
    Swap(other);
    return *this;
  }
  ~IdMap() = default;

  // Null if there is no such id.
  const Value* Find(Key key) const { return IsSlot(key) ? slots_[IndexOf(key)] : nullptr; }
  Value* Find(Key key) { return IsSlot(key) ? slots_[IndexOf(key)] : nullptr; }
  bool Has(Key key) const { return Find(key) != nullptr; }
  // The key must be valid; an old value is replaced.
  Value& Put(Key key, Value value) {
    if (!IsSlot(key)) slots_.resize(IndexOf(key) + 1);
    Value*& slot = slots_[IndexOf(key)];
    if (slot == nullptr) slot = TakeFree();
    *slot = std::move(value);
    return *slot;
  }
  void Remove(Key key) {
    if (Value* value = Find(key)) {
      *value = Value{};
      free_.push_back(value);
      slots_[IndexOf(key)] = nullptr;
    }
  }
  int64_t size() const { return static_cast<int64_t>(chunks_.size() * kChunk - free_.size()); }
  // One more than the highest id that was ever put.
  int64_t end_id() const { return static_cast<int64_t>(slots_.size()); }

  // Calls visit(key, value) in the order of ids.
  template <class Visit>
  void ForEach(Visit visit) const {
    for (size_t i = 0; i < slots_.size(); ++i) {
      if (slots_[i] != nullptr) {
        visit(Key{static_cast<int64_t>(i)}, std::as_const(*slots_[i]));
      }
    }
  }

 private:
  static constexpr size_t kChunk = 64;  // values

  static size_t IndexOf(Key key) { return static_cast<size_t>(key.value); }
  bool IsSlot(Key key) const { return key.valid() && IndexOf(key) < slots_.size(); }

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
    std::swap(slots_, other.slots_);
    std::swap(chunks_, other.chunks_);
    std::swap(free_, other.free_);
  }

  std::vector<Value*> slots_;  // by id; null: no such id
  std::vector<std::unique_ptr<std::array<Value, kChunk>>> chunks_;
  std::vector<Value*> free_;  // of the chunks; the last one is taken next
};

}  // namespace tessera
