// A short list of plain values that keeps up to kNumInside of them in itself, so that most lists need no memory of
// their own.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>

namespace tessera {

template <class T, uint32_t kNumInside>
class SmallVector {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  SmallVector() = default;
  SmallVector(const SmallVector& other) { *this = other; }
  SmallVector(SmallVector&& other) noexcept { *this = std::move(other); }
  SmallVector& operator=(const SmallVector& other) {
    if (this == &other) return *this;
    if (other.size_ > capacity_) Grow(other.size_);
    std::copy(other.begin(), other.end(), data());
    size_ = other.size_;
    return *this;
  }
  SmallVector& operator=(SmallVector&& other) noexcept {
    if (this == &other) return *this;
    outside_ = std::move(other.outside_);
    inside_ = other.inside_;
    size_ = std::exchange(other.size_, 0);
    capacity_ = std::exchange(other.capacity_, kNumInside);
    return *this;
  }
  ~SmallVector() = default;

  size_t size() const { return size_; }
  const T* begin() const { return outside_ != nullptr ? outside_.get() : inside_.data(); }
  const T* end() const { return begin() + size_; }
  std::span<const T> span() const { return {begin(), size_}; }

  // Before `next`, an element of this list or its end.
  void Insert(const T* next, const T& value) {
    const T added = value;
    const ptrdiff_t at = next - begin();
    if (size_ == capacity_) Grow(2 * capacity_);
    std::copy_backward(data() + at, data() + size_, data() + size_ + 1);
    data()[at] = added;
    ++size_;
  }
  void Remove(const T* element) {
    std::copy(element + 1, end(), data() + (element - begin()));
    --size_;
  }

 private:
  T* data() { return outside_ != nullptr ? outside_.get() : inside_.data(); }
  void Grow(uint32_t capacity) {
    auto larger = std::make_unique<T[]>(capacity);
    std::copy(begin(), end(), larger.get());
    outside_ = std::move(larger);
    capacity_ = capacity;
  }

  std::unique_ptr<T[]> outside_;  // null: they are inside
  std::array<T, kNumInside> inside_{};
  uint32_t size_ = 0;
  uint32_t capacity_ = kNumInside;
};

}  // namespace tessera
