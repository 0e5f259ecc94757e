// How messages and values correspond: each message type has one description, which serves to encode and to decode it.
//
//   template <>
//   struct Layout<loop_result_t> {
//     template <class Fields, class Message, class Value>
//     static void Describe(Fields& fields, Message& message, Value& result) {
//       fields.Key(message.keyframe, result.answers);          // tells values apart: the same in all parts of one
//       fields(message.joins_parts, result.joins_parts);       // a field and a member (field_conversions.h)
//       fields.Check(result.answers.valid(), "its keyframe is out of range");
//       fields.List(message.num_seen, message.seen, result.seen);
//     }
//   };
//
// `Fields` is a PartWriter (the message is filled) or a PartReader (the value is). A value that is too large for one
// message travels in parts: all fields are in every part, and lists, in the order of the description, are dealt out to
// the parts as their items fit. The sizes of items are those that the generated types report.
//
//   fields(field, member)             a leaf, or a message with a layout of its own
//   fields.Key(field, member)         the same; a part with another one belongs to another value
//   fields.Time(field, member)        us
//   fields.Count(field, member)       not negative
//   fields.Bits(field, member)        64 bits of any content
//   fields.Implied(member, constant)  what the type of the message says
//   fields.Check(holds, sentence)     a condition on what was read before it; must be safe for any numbers
//   fields.CheckWhole(holds, sentence)   a condition, to be called, on the whole value: once its last part was read
//   fields.Once(num, items, value)    an item with a layout of its own, in the first part alone
//   fields.List(num, items, members)  a list of items, each a leaf or a message with a layout
//   fields.CutList(num, items, members)              items that have a WholeTable, within which they may be cut
//   fields.Table(num, is_valid, columns...)          row i is item i of each column; is_valid(i) checks member i
//   fields.WholeTable(total, first, num, is_valid, columns...)   also says how many rows there are, and which these are
//   fields.Bands(band, images...)                    the pixels of images, one band a part
//   fields.Target(pointer)                           what a shared pointer to a constant points to
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "wire/field_conversions.h"

namespace tessera {

template <class Message>
struct Layout;

template <class Message>
concept HasLayout = requires { sizeof(Layout<std::remove_const_t<Message>>); };

// Bytes on the wire of one item of an array.
template <class Item>
size_t WireSize(const Item& item) {
  if constexpr (std::is_arithmetic_v<Item>) {
    return sizeof(Item);
  } else if constexpr (std::is_same_v<Item, std::string>) {
    return sizeof(int32_t) + item.size() + 1;
  } else {
    return static_cast<size_t>(item._getEncodedSizeNoHash());
  }
}

// An array of a message and the list whose items, or one member of them, it carries.
template <class Items, class Values, class Member = std::identity>
class Column {
 public:
  Column(Items& items, Values& values, Member member = {}) : items_(items), values_(values), member_(member) {}

  size_t size() const { return values_.size(); }
  void Grow(size_t num) {
    if (values_.size() < num) values_.resize(num);
  }
  size_t BytesOf(size_t i) const {
    using Item = typename std::remove_const_t<Items>::value_type;
    if constexpr (std::is_same_v<Item, std::string>) {
      return WireSize(std::invoke(member_, values_[i]));
    } else {
      return WireSize(Item{});
    }
  }
  void Write(size_t first, size_t num) {
    items_.resize(num);
    for (size_t i = 0; i < num; ++i) WriteField(std::invoke(member_, values_[first + i]), items_[i]);
  }
  Result<> Read(size_t first, size_t num) {
    for (size_t i = 0; i < num; ++i) {
      TESSERA_RETURN_IF_FAILED(ReadField(items_[i], std::invoke(member_, values_[first + i])));
    }
    return {};
  }
  void SetCount(int32_t) {}
  bool HasCount(int32_t) const { return true; }

 private:
  Items& items_;
  Values& values_;
  Member member_;
};

// A column with a count of its own, which equals that of its table.
template <class Num, class Items, class Values>
class CountedColumn : public Column<Items, Values> {
 public:
  CountedColumn(Num& num, Items& items, Values& values) : Column<Items, Values>(items, values), num_(num) {}

  void SetCount(int32_t num) { num_ = num; }
  bool HasCount(int32_t num) const { return num_ == num; }

 private:
  Num& num_;
};

// For tables whose members need no check beyond that of their kind.
inline bool AnyRow(size_t /*row*/) { return true; }

// An image of a value, of the size that its other members say.
template <class SomeImage>
struct ImageField {
  int8_t name = 0;  // image_band_t::LEFT, RIGHT or DEPTH
  SomeImage& image;
  int width = 0;  // px; 0: there is none
  int height = 0;
};
template <class SomeImage>
ImageField(int8_t, SomeImage&, int, int) -> ImageField<SomeImage>;

}  // namespace tessera
