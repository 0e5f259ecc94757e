// A map from ids to values for ids that are handed out by counting: an array of slots, so that looking up is one
// indexing and walking is in the order of ids. A removed id leaves a slot of eight bytes.
#pragma once

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
  IdMap(const IdMap& other) : num_values_(other.num_values_) {
    slots_.reserve(other.slots_.size());
    for (const auto& slot : other.slots_) {
      slots_.push_back(slot ? std::make_unique<Value>(*slot) : nullptr);
    }
  }
  IdMap(IdMap&&) noexcept = default;
  IdMap& operator=(IdMap other) noexcept {
    std::swap(slots_, other.slots_);
    std::swap(num_values_, other.num_values_);
    return *this;
  }
  ~IdMap() = default;

  // Null if there is no such id.
  const Value* Find(Key key) const { return Has(key) ? slots_[static_cast<size_t>(key.value)].get() : nullptr; }
  Value* Find(Key key) { return Has(key) ? slots_[static_cast<size_t>(key.value)].get() : nullptr; }
  bool Has(Key key) const {
    return key.valid() && static_cast<size_t>(key.value) < slots_.size() &&
           slots_[static_cast<size_t>(key.value)] != nullptr;
  }
  // The key must be valid; an old value is replaced.
  Value& Put(Key key, Value value) {
    const auto index = static_cast<size_t>(key.value);
    if (index >= slots_.size()) {
      slots_.resize(index + 1);
    }
    num_values_ += slots_[index] == nullptr ? 1 : 0;
    slots_[index] = std::make_unique<Value>(std::move(value));
    return *slots_[index];
  }
  void Remove(Key key) {
    if (Has(key)) {
      slots_[static_cast<size_t>(key.value)].reset();
      --num_values_;
    }
  }
  int64_t size() const { return num_values_; }
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
  std::vector<std::unique_ptr<Value>> slots_;
  int64_t num_values_ = 0;
};

}  // namespace tessera
