// Reads the messages of one value, part by part, and believes nothing (layout.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tessera/image_band_t.hpp"
#include "wire/image_bands.h"
#include "wire/layout.h"

namespace tessera {

class PartReader {
 public:
  // `begins`: the first part of a value. `ends`: its last one.
  void BeginPart(bool begins, bool ends) {
    begins_ = begins;
    ends_ = ends;
    is_incomplete_ = false;
    if (begins) is_item_cut_ = false;
    verdict_ = {};
  }
  // What is wrong with the part that was described. After the last one, nothing may be missing.
  Result<> EndPart() {
    if (ends_) Check(!is_incomplete_ && !is_item_cut_, "not all of it came");
    return std::move(verdict_);
  }

  template <class Field, class Member>
  void operator()(const Field& field, Member& member) {
    if constexpr (HasLayout<Field>) {
      Layout<Field>::Describe(*this, field, member);
    } else if (begins_ && verdict_) {
      if (Result<> read = ReadField(field, member); !read) verdict_ = std::move(read);
    }
  }
  template <class Field, class Member>
  void Key(const Field& field, Member& member) {
    if (begins_) return (*this)(field, member);
    Member same{};
    Check(ReadField(field, same).has_value() && same == member, kUnfit);
  }
  void Time(const int64_t& field, int64_t& member_us) {
    constexpr int64_t kMaxTimeUs = int64_t{1} << 56;  // year 4253
    (*this)(field, member_us);
    Check(field > -kMaxTimeUs && field < kMaxTimeUs, "its time is out of range");
  }
  template <class Field, class Member>
  void Count(const Field& field, Member& member) {
    (*this)(field, member);
    Check(field >= 0, "one of its counts is negative");
  }
  void Bits(const int64_t& field, uint64_t& member) { member = static_cast<uint64_t>(field); }
  template <class Member>
  void Implied(Member& member, const Member& constant) {
    member = constant;
  }
  void Check(bool holds, const char* sentence) {
    if (!holds && verdict_) verdict_ = Failed(sentence);
  }
  template <class Holds>
  void CheckWhole(Holds holds, const char* sentence) {
    if (ends_ && verdict_) Check(holds(), sentence);
  }
  // Made at the beginning, and shared with nobody before the value is complete.
  template <class Pointee>
  Pointee& Target(std::shared_ptr<const Pointee>& pointer) {
    if (begins_) pointer = std::make_shared<Pointee>();
    return const_cast<Pointee&>(*pointer);
  }

  template <class Item, class Value>
  void Once(int32_t num, const std::vector<Item>& items, Value& value) {
    Check(num == (begins_ ? 1 : 0), kUnfit);
    if (begins_ && verdict_) (*this)(items[0], value);
  }

  template <class Item, class Member>
  void List(int32_t num, const std::vector<Item>& items, std::vector<Member>& members) {
    Check(members.size() + static_cast<size_t>(num) <= kMaxItems, "one of its lists is longer than any would be");
    if (!verdict_) return;
    const size_t begin = members.size();
    const bool begins = std::exchange(begins_, true);
    members.resize(begin + static_cast<size_t>(num));
    for (size_t i = 0; i < static_cast<size_t>(num) && verdict_; ++i) (*this)(items[i], members[begin + i]);
    begins_ = begins;
  }

  template <class Item, class Member>
  void CutList(int32_t num, const std::vector<Item>& items, std::vector<Member>& members) {
    Check(members.size() + static_cast<size_t>(num) <= kMaxCutItems, "one of its lists is longer than any would be");
    for (size_t i = 0; i < static_cast<size_t>(num) && verdict_; ++i) {
      if (!is_item_cut_) members.emplace_back();
      PartReader part;
      part.BeginPart(!is_item_cut_, false);
      part(items[i], members.back());
      is_item_cut_ = part.is_incomplete_;
      verdict_ = part.EndPart();
      Check(!is_item_cut_ || i + 1 == static_cast<size_t>(num), kUnfit);
    }
  }

  template <class IsValid, class First, class... Others>
  void Table(int32_t num, IsValid is_valid, First first_column, Others... columns) {
    const size_t begin = first_column.size();
    const size_t num_rows = static_cast<size_t>(num);
    Check(begin + num_rows <= kMaxItems, "one of its lists is longer than any would be");
    Check((first_column.HasCount(num) && ... && columns.HasCount(num)), "its lists differ in length");
    if (!verdict_) return;
    const auto read = [&](auto& column) {
      column.Grow(begin + num_rows);
      if (verdict_) verdict_ = column.Read(begin, num_rows);
    };
    read(first_column);
    (read(columns), ...);
    for (size_t i = begin; i < begin + num_rows && verdict_; ++i) {
      Check(is_valid(i), "an entry of one of its lists is out of range");
    }
  }

  template <class IsValid, class First, class... Others>
  void WholeTable(int32_t total, int32_t first, int32_t num, IsValid is_valid, First first_column, Others... columns) {
    const auto end = static_cast<int64_t>(first_column.size()) + num;
    Check(first == static_cast<int64_t>(first_column.size()) && total <= kMaxRows && end <= total, kUnfit);
    is_incomplete_ = end < total;
    Table(num, is_valid, first_column, columns...);
  }

  template <class... SomeImages>
  void Bands(const image_band_t& band, const ImageField<SomeImages>&... images) {
    bool is_taken = false;
    bool is_complete = true;
    bool has_pixels = false;
    const auto take = [&](const auto& field) {
      const size_t num_pixels = static_cast<size_t>(field.width) * static_cast<size_t>(field.height);
      has_pixels = has_pixels || num_pixels > 0;
      if (!is_taken && field.image.pixels.size() < num_pixels) {
        is_taken = true;
        Check(band.image == field.name, "its parts are not in order");
        if (verdict_) verdict_ = AppendBand(band, field.width, field.height, &field.image);
      }
      is_complete = is_complete && field.image.pixels.size() == num_pixels;
    };
    (take(images), ...);
    Check(is_taken || (!has_pixels && band.num_bytes == 0), "it has more pixels than its images");
    is_incomplete_ = !is_complete;
  }

 private:
  static constexpr const char* kUnfit = "its parts do not fit together";
  // Far beyond what any value holds.
  static constexpr size_t kMaxItems = size_t{1} << 24;
  static constexpr int32_t kMaxRows = 1 << 20;
  static constexpr size_t kMaxCutItems = size_t{1} << 16;

  bool begins_ = true;
  bool ends_ = false;
  bool is_incomplete_ = false;  // a WholeTable or the Bands of the last part lack something
  bool is_item_cut_ = false;    // the last item of a CutList does
  Result<> verdict_;
};

}  // namespace tessera
