// Fills the messages of one value, part by part (layout.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "tessera/image_band_t.hpp"
#include "wire/image_bands.h"
#include "wire/layout.h"

namespace tessera {

class PartWriter {
 public:
  // Describing the value now leaves all lists empty: what is left then is in every part.
  void BeginEmptyPart() {
    is_empty_part_ = true;
    Begin(0);
  }
  // Describing it now takes as many more items as fit into `room` bytes. An item larger than that goes alone if
  // `may_exceed`, so that every part brings the value further.
  void BeginPart(size_t room, bool may_exceed = true) {
    is_empty_part_ = false;
    may_exceed_ = may_exceed;
    Begin(room);
  }
  // All items have been taken.
  bool done() const { return is_through_; }

  template <class Field, class Member>
  void operator()(Field& field, const Member& member) {
    if constexpr (HasLayout<Field>) {
      Layout<Field>::Describe(*this, field, member);
    } else {
      WriteField(member, field);
    }
  }
  template <class Field, class Member>
  void Key(Field& field, const Member& member) {
    WriteField(member, field);
  }
  void Time(int64_t& field, int64_t member_us) { field = member_us; }
  template <class Field, class Member>
  void Count(Field& field, const Member& member) {
    WriteField(member, field);
  }
  void Bits(int64_t& field, uint64_t member) { field = static_cast<int64_t>(member); }
  template <class Member>
  void Implied(const Member& /*member*/, const Member& /*constant*/) {}
  void Check(bool /*holds*/, const char* /*sentence*/) {}
  template <class Holds>
  void CheckWhole(const Holds& /*holds*/, const char* /*sentence*/) {}
  template <class Pointee>
  const Pointee& Target(const std::shared_ptr<const Pointee>& pointer) {
    return *pointer;
  }

  template <class Item, class Value>
  void Once(int32_t& num, std::vector<Item>& items, const Value& value) {
    items.clear();
    size_t& next = next_of_list();
    ++list_;
    const bool is_first = next == 0 && !is_empty_part_;
    if (is_first) {
      PartWriter whole;
      whole.BeginPart(SIZE_MAX);
      whole(items.emplace_back(), value);
      Fits(WireSize(items.back()));
      next = 1;
    }
    num = is_first ? 1 : 0;
  }

  template <class Item, class Member>
  void List(int32_t& num, std::vector<Item>& items, const std::vector<Member>& members) {
    items.clear();
    TakeWhile(members.size(), [&](size_t i) {
      (*this)(items.emplace_back(), members[i]);
      const bool fits = Fits(WireSize(items.back()));
      if (!fits) items.pop_back();
      return fits;
    });
    num = static_cast<int32_t>(items.size());
  }

  template <class Item, class Member>
  void CutList(int32_t& num, std::vector<Item>& items, const std::vector<Member>& members) {
    items.clear();
    TakeWhile(members.size(), [&](size_t i) {
      Item item{};
      PartWriter part;
      part.next_ = cut_item_;
      if (!WritePartOf(members[i], &part, &item)) return false;
      items.push_back(std::move(item));
      cut_item_ = part.done() ? std::vector<size_t>() : part.next_;
      return part.done();
    });
    num = static_cast<int32_t>(items.size());
  }

  template <class IsValid, class First, class... Others>
  void Table(int32_t& num, IsValid /*is_valid*/, First first_column, Others... columns) {
    const size_t begin = next_of_list();
    size_t end = begin;
    TakeWhile(first_column.size(), [&](size_t i) {
      if (!Fits((first_column.BytesOf(i) + ... + columns.BytesOf(i)))) return false;
      end = i + 1;
      return true;
    });
    num = static_cast<int32_t>(end - begin);
    const auto write = [&](auto& column) {
      column.Write(begin, end - begin);
      column.SetCount(num);
    };
    write(first_column);
    (write(columns), ...);
  }

  template <class IsValid, class First, class... Others>
  void WholeTable(int32_t& total, int32_t& first, int32_t& num, IsValid is_valid, First first_column,
                  Others... columns) {
    total = static_cast<int32_t>(first_column.size());
    first = static_cast<int32_t>(next_of_list());
    Table(num, is_valid, first_column, columns...);
  }

  template <class... SomeImages>
  void Bands(image_band_t& band, const ImageField<SomeImages>&... images) {
    band.image = band.encoding = 0;
    WriteField(Rect{}, band.pixels);
    band.num_bytes = 0;
    band.data.clear();
    size_t& next = next_of_list();
    ++list_;
    if (is_empty_part_) return;
    size_t begin = 0;  // of an image, in pixels of all
    bool is_filled = false;
    const auto put = [&](const auto& field) {
      const size_t end = begin + field.image.pixels.size();
      if (!is_filled && next < end) {
        next += FillBand(field.name, field.image, next - begin, room_, &band);
        is_filled = true;
      }
      begin = end;
    };
    (put(images), ...);
    is_through_ = next == begin;
  }

 private:
  void Begin(size_t room) {
    room_ = room;
    list_ = 0;
    is_through_ = true;
    has_items_ = false;
  }
  // How many items of the list that is described next have been taken.
  size_t& next_of_list() {
    if (next_.size() <= list_) next_.resize(list_ + 1);
    return next_[list_];
  }
  // Takes items of the list one after the other while `take(i)` says that item i is through; no list begins before
  // those in front of it are through.
  template <class Take>
  void TakeWhile(size_t num_items, Take take) {
    size_t& next = next_of_list();
    ++list_;
    if (is_empty_part_ || !is_through_) return;
    while (next < num_items && take(next)) ++next;
    is_through_ = next == num_items;
  }
  bool Fits(size_t num_bytes) {
    if (num_bytes > room_ && (has_items_ || !may_exceed_)) return false;
    room_ -= std::min(room_, num_bytes);
    has_items_ = true;
    return true;
  }
  // As much of an item as fits. False if that is nothing.
  template <class Item, class Member>
  bool WritePartOf(const Member& member, PartWriter* part, Item* item) {
    part->BeginEmptyPart();
    (*part)(*item, member);
    const size_t overhead = WireSize(*item);
    if (overhead > room_ && has_items_) return false;
    part->BeginPart(room_ - std::min(room_, overhead), may_exceed_ && !has_items_);
    (*part)(*item, member);
    if (!part->done() && !part->has_items_) return false;
    return Fits(WireSize(*item));
  }

  bool is_empty_part_ = false;
  bool may_exceed_ = true;
  size_t room_ = 0;               // bytes left in this part
  bool has_items_ = false;        // this part
  bool is_through_ = true;        // all lists that were described so far, with all their items
  size_t list_ = 0;               // that is described next
  std::vector<size_t> next_;      // by list: the first item that was not taken
  std::vector<size_t> cut_item_;  // the same within the item of a CutList that a part ended in
};

}  // namespace tessera
