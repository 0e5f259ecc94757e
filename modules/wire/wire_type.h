// The layout of LCM types, and whether received bytes have it.
//
// Decoders that lcm-gen makes believe the array lengths in a message: a negative or huge one makes them allocate
// without bound or throw. So no byte reaches them before it has been walked over here, by the same `.lcm` texts that
// they were made from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "wire/bytes.h"

namespace tessera {

class WireType {
 public:
  // The type of that name, such as "pose_t". Throws std::logic_error if lcmtypes/ has none.
  static const WireType& Named(std::string_view name);
  // The type whose fingerprint stands at the front of `message`; null if there is none.
  static const WireType* Of(ByteView message);

  // Whether `message` is exactly one message of this type: its fingerprint, every field there, every array length
  // not negative and its elements there, every text terminated and without control characters, and nothing behind.
  bool Matches(ByteView message) const;
  // Whether `fields` begins with the fields of this type, without fingerprint; anything may follow.
  bool MatchesFront(ByteView fields) const;

  const std::string& name() const { return name_; }
  // LCM's hash of the field names, types and dimensions, the first 8 bytes of each message.
  int64_t fingerprint() const { return fingerprint_; }

 private:
  struct Dimension {
    int constant = 0;      // number of elements, or
    int count_field = -1;  // the index of the field that holds it
  };
  struct Field {
    std::string type;
    std::string name;
    std::vector<std::string> dimension_texts;  // as written between the brackets
    std::vector<Dimension> dimensions;
    size_t size = 0;                    // bytes of one element; 0: it varies
    const WireType* type_of = nullptr;  // null: primitive or text
    bool is_count = false;              // some array's length
  };
  class Reader;
  friend class WireTypeTable;

  bool Walk(Reader& reader) const;
  static bool WalkElements(const Field& field, size_t num_elements, Reader& reader);
  uint64_t OwnHash() const;
  uint64_t TotalHash() const;

  std::string name_;
  std::vector<Field> fields_;
  size_t size_ = 0;           // bytes of a value, without fingerprint; 0: it varies
  bool is_resolved_ = false;  // sizes are known
  int64_t fingerprint_ = 0;
};

}  // namespace tessera
