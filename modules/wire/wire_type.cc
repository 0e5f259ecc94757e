#include "wire/wire_type.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <map>
#include <stdexcept>

#include "tessera/type_texts.h"

namespace tessera {
namespace {

constexpr size_t kMaxFields = 48;  // of one type

int64_t ReadBigEndian(const uint8_t* bytes, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i) {
    value = (value << 8) | bytes[i];
  }
  return static_cast<int64_t>(value);
}

// Bytes of a primitive type; 0 if it is none (or text).
size_t PrimitiveSize(const std::string& type) {
  static const std::map<std::string, size_t> kSizes = {{"int8_t", 1},  {"byte", 1},    {"boolean", 1}, {"int16_t", 2},
                                                       {"int32_t", 4}, {"int64_t", 8}, {"float", 4},   {"double", 8}};
  const auto it = kSizes.find(type);
  return it == kSizes.end() ? 0 : it->second;
}

bool IsPrimitive(const std::string& type) { return type == "string" || PrimitiveSize(type) > 0; }

// Words and punctuation of an .lcm text, without comments.
std::vector<std::string> Tokenize(std::string_view text) {
  std::vector<std::string> tokens;
  for (size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (text.substr(i, 2) == "//") {
      i = std::min(text.find('\n', i), text.size());
    } else if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') {
      size_t end = i;
      while (end < text.size() && (std::isalnum(static_cast<unsigned char>(text[end])) != 0 || text[end] == '_')) ++end;
      tokens.emplace_back(text.substr(i, end - i));
      i = end;
    } else {
      if (std::isspace(static_cast<unsigned char>(c)) == 0) tokens.emplace_back(1, c);
      ++i;
    }
  }
  return tokens;
}

}  // namespace

// What is left of a message.
class WireType::Reader {
 public:
  explicit Reader(ByteView bytes) : bytes_(bytes) {}

  size_t remaining() const { return bytes_.size(); }
  bool Skip(size_t num_bytes) {
    if (num_bytes > bytes_.size()) return false;
    bytes_ = bytes_.subspan(num_bytes);
    return true;
  }
  bool ReadInteger(size_t size, int64_t* value) {
    if (size > bytes_.size()) return false;
    *value = ReadBigEndian(bytes_.data(), size);
    if (size == 4) *value = static_cast<int32_t>(*value);
    return Skip(size);
  }
  // Text: its length with the terminating zero (int32_t), then its bytes.
  bool SkipText() {
    int64_t length = 0;
    if (!ReadInteger(4, &length) || length < 1 || static_cast<size_t>(length) > bytes_.size()) return false;
    const ByteView text = bytes_.first(static_cast<size_t>(length) - 1);
    const bool has_controls = std::any_of(text.begin(), text.end(), [](uint8_t c) { return c < 0x20 || c == 0x7f; });
    return !has_controls && bytes_[text.size()] == 0 && Skip(static_cast<size_t>(length));
  }

 private:
  ByteView bytes_;
};

// All types of lcmtypes/, read once.
class WireTypeTable {
 public:
  static const WireTypeTable& Get() {
    static const WireTypeTable table;
    return table;
  }
  std::map<std::string, WireType, std::less<>> by_name;
  std::map<int64_t, const WireType*> by_fingerprint;

 private:
  WireTypeTable() {
    for (const char* text : kTypeTexts) {
      WireType type = Parse(text);
      by_name.emplace(type.name_, std::move(type));
    }
    for (auto& [name, type] : by_name) Resolve(&type);
    for (auto& [name, type] : by_name) {
      type.fingerprint_ = static_cast<int64_t>(type.TotalHash());
      by_fingerprint[type.fingerprint_] = &type;
    }
  }

  // package tessera; struct NAME { TYPE NAME [DIMENSION]...; const ...; }
  static WireType Parse(const char* text) {
    const std::vector<std::string> tokens = Tokenize(text);
    auto at = std::find(tokens.begin(), tokens.end(), "struct");
    WireType type;
    type.name_ = *++at;
    for (at += 2; *at != "}"; ++at) {
      if (*at == "const") {
        at = std::find(at, tokens.end(), ";");
        continue;
      }
      WireType::Field field;
      field.type = *at++;
      field.name = *at++;
      for (; *at == "["; at += 3) field.dimension_texts.push_back(at[1]);
      type.fields_.push_back(std::move(field));
    }
    if (type.fields_.size() > kMaxFields) throw std::logic_error(type.name_ + " has more fields than kMaxFields");
    return type;
  }

  void Resolve(WireType* type) {
    if (type->is_resolved_) return;
    type->is_resolved_ = true;
    size_t size = 0;
    bool varies = false;
    for (WireType::Field& field : type->fields_) {
      ResolveElement(&field);
      size_t num_elements = 1;
      for (const std::string& text : field.dimension_texts) {
        field.dimensions.push_back(ResolveDimension(type, text));
        num_elements *= static_cast<size_t>(field.dimensions.back().constant);
      }
      varies = varies || field.size == 0 || num_elements == 0;
      size += field.size * num_elements;
    }
    type->size_ = varies ? 0 : size;
  }
  void ResolveElement(WireType::Field* field) {
    field->size = PrimitiveSize(field->type);
    if (IsPrimitive(field->type)) return;
    WireType& type = by_name.at(field->type);
    Resolve(&type);
    field->type_of = &type;
    field->size = type.size_;
  }
  static WireType::Dimension ResolveDimension(WireType* type, const std::string& text) {
    if (std::isdigit(static_cast<unsigned char>(text.front())) != 0) return {.constant = std::stoi(text)};
    for (size_t i = 0; i < type->fields_.size(); ++i) {
      if (type->fields_[i].name == text && type->fields_[i].size == 4) {
        type->fields_[i].is_count = true;
        return {.count_field = static_cast<int>(i)};
      }
    }
    throw std::logic_error(type->name_ + ": the length `" + text + "` must be an int32_t field before the array");
  }
};

const WireType& WireType::Named(std::string_view name) {
  const auto& types = WireTypeTable::Get().by_name;
  const auto it = types.find(name);
  if (it == types.end()) throw std::logic_error("lcmtypes/ has no type " + std::string(name));
  return it->second;
}

const WireType* WireType::Of(ByteView message) {
  if (message.size() < 8) return nullptr;
  const auto& types = WireTypeTable::Get().by_fingerprint;
  const auto it = types.find(ReadBigEndian(message.data(), 8));
  return it == types.end() ? nullptr : it->second;
}

bool WireType::Matches(ByteView message) const {
  Reader reader(message);
  int64_t fingerprint = 0;
  return reader.ReadInteger(8, &fingerprint) && fingerprint == fingerprint_ && Walk(reader) && reader.remaining() == 0;
}

bool WireType::MatchesFront(ByteView fields) const {
  Reader reader(fields);
  return Walk(reader);
}

bool WireType::Walk(Reader& reader) const {
  if (size_ > 0) return reader.Skip(size_);
  std::array<int64_t, kMaxFields> counts;
  for (size_t i = 0; i < fields_.size(); ++i) {
    const Field& field = fields_[i];
    if (field.is_count) {
      if (!reader.ReadInteger(4, &counts[i]) || counts[i] < 0) return false;
      continue;
    }
    size_t num_elements = 1;
    for (const Dimension& dimension : field.dimensions) {
      num_elements *= dimension.count_field < 0
                          ? static_cast<size_t>(dimension.constant)
                          : static_cast<size_t>(counts[static_cast<size_t>(dimension.count_field)]);
      // Every element has at least one byte, so this also keeps the product from overflowing.
      if (num_elements > reader.remaining()) return false;
    }
    if (!WalkElements(field, num_elements, reader)) return false;
  }
  return true;
}

bool WireType::WalkElements(const Field& field, size_t num_elements, Reader& reader) {
  if (field.size > 0) return reader.Skip(num_elements * field.size);
  for (size_t i = 0; i < num_elements; ++i) {
    if (!(field.type_of == nullptr ? reader.SkipText() : field.type_of->Walk(reader))) return false;
  }
  return true;
}

namespace {

// The steps of lcm-gen's hash: signed shifts, as there.
uint64_t HashByte(uint64_t hash, char c) {
  const int64_t signed_hash = static_cast<int64_t>(hash);
  return ((hash << 8) ^ static_cast<uint64_t>(signed_hash >> 55)) + static_cast<uint64_t>(static_cast<int64_t>(c));
}
uint64_t HashText(uint64_t hash, const std::string& text) {
  hash = HashByte(hash, static_cast<char>(text.size()));
  for (const char c : text) hash = HashByte(hash, c);
  return hash;
}

}  // namespace

uint64_t WireType::OwnHash() const {
  uint64_t hash = 0x12345678;
  for (const Field& field : fields_) {
    hash = HashText(hash, field.name);
    if (field.type_of == nullptr) hash = HashText(hash, field.type);
    hash = HashByte(hash, static_cast<char>(field.dimensions.size()));
    for (size_t i = 0; i < field.dimensions.size(); ++i) {
      hash = HashByte(hash, field.dimensions[i].count_field < 0 ? 0 : 1);
      hash = HashText(hash, field.dimension_texts[i]);
    }
  }
  return hash;
}

uint64_t WireType::TotalHash() const {
  uint64_t hash = OwnHash();
  for (const Field& field : fields_) {
    if (field.type_of != nullptr) hash += field.type_of->TotalHash();
  }
  return (hash << 1) + ((hash >> 63) & 1);
}

}  // namespace tessera
