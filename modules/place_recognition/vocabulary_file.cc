// Vocabularies on disk. All numbers least significant byte first:
//
//   "tessera vocabulary\n", version (4), num_nodes (4), num_words (4), direct_level (4), length of the origin (4),
//   origin, number of children of each node (1), center of each node (4 x 8), weight of each word (float, 4), SHA-256
//   of all that in 64 hexadecimal digits.
#include <bit>
#include <cstring>
#include <string_view>
#include <utility>

#include "core/errors.h"
#include "core/files.h"
#include "core/sha256.h"
#include "place_recognition/vocabulary.h"

namespace tessera {
namespace {

constexpr std::string_view kMagic = "tessera vocabulary\n";
constexpr uint32_t kVersion = 1;
constexpr size_t kHeaderBytes = kMagic.size() + 5 * sizeof(uint32_t);
constexpr size_t kDigestBytes = 64;
constexpr const char* kIsTruncated = " is truncated: copy it again, or train it anew";
constexpr const char* kIsDamaged = " is damaged: copy it again, or train it anew";

static_assert(std::endian::native == std::endian::little, "numbers go to the file as they stand in memory");

class Writer {
 public:
  void Add(const void* bytes, size_t num_bytes) { text_.append(static_cast<const char*>(bytes), num_bytes); }
  void AddNumber(size_t number) {
    const auto value = static_cast<uint32_t>(number);
    Add(&value, sizeof(value));
  }
  template <class Value>
  void AddAll(const std::vector<Value>& values) {
    Add(values.data(), values.size() * sizeof(Value));
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

// Takes values off the front of text that is known to be long enough.
class Reader {
 public:
  explicit Reader(std::string_view text) : rest_(text) {}

  void Take(void* bytes, size_t num_bytes) {
    if (num_bytes > 0) std::memcpy(bytes, rest_.data(), num_bytes);
    rest_.remove_prefix(num_bytes);
  }
  void Skip(size_t num_bytes) { rest_.remove_prefix(num_bytes); }
  uint32_t TakeNumber() {
    uint32_t value = 0;
    Take(&value, sizeof(value));
    return value;
  }
  template <class Value>
  void TakeAll(std::vector<Value>& values, size_t num_values) {
    values.resize(num_values);
    Take(values.data(), num_values * sizeof(Value));
  }

 private:
  std::string_view rest_;
};

std::string DigestOf(std::string_view text) {
  Sha256 sha256;
  sha256.Add(text.data(), text.size());
  return sha256.HexDigest();
}

std::string Encode(const VocabularyTree& tree) {
  Writer writer;
  writer.Add(kMagic.data(), kMagic.size());
  writer.AddNumber(kVersion);
  writer.AddNumber(tree.num_children.size());
  writer.AddNumber(tree.idf.size());
  writer.AddNumber(static_cast<size_t>(tree.direct_level));
  writer.AddNumber(tree.origin.size());
  writer.Add(tree.origin.data(), tree.origin.size());
  writer.AddAll(tree.num_children);
  writer.AddAll(tree.centers);
  writer.AddAll(tree.idf);
  return writer.text() + DigestOf(writer.text());
}

struct Header {
  size_t num_nodes = 0;
  size_t num_words = 0;
  int32_t direct_level = 0;
  size_t origin_bytes = 0;

  // Of the whole file.
  size_t num_bytes() const {
    return kHeaderBytes + origin_bytes + num_nodes * (sizeof(uint8_t) + sizeof(Descriptor)) +
           num_words * sizeof(float) + kDigestBytes;
  }
};

// Leaves `reader` behind the header. `name` is for sentences.
Header TakeHeader(std::string_view text, const std::string& name, Reader& reader) {
  if (text.substr(0, kMagic.size()) != kMagic.substr(0, text.size())) {
    throw InputError(name + " is not a vocabulary: give a file that `tessera vocabulary train` wrote");
  }
  if (text.size() < kHeaderBytes) throw InputError(name + kIsTruncated);
  reader.Skip(kMagic.size());
  if (const uint32_t version = reader.TakeNumber(); version != kVersion) {
    throw InputError(name + " is of version " + std::to_string(version) + " and this program reads version " +
                     std::to_string(kVersion) + ": train it anew with `tessera vocabulary train`");
  }
  Header header;
  header.num_nodes = reader.TakeNumber();
  header.num_words = reader.TakeNumber();
  header.direct_level = static_cast<int32_t>(reader.TakeNumber());
  header.origin_bytes = reader.TakeNumber();
  return header;
}

VocabularyTree Decode(std::string_view text, const std::string& name) {
  Reader reader(text);
  const Header header = TakeHeader(text, name, reader);
  if (text.size() < header.num_bytes()) throw InputError(name + kIsTruncated);
  const size_t num_signed = header.num_bytes() - kDigestBytes;
  if (text.size() > header.num_bytes() || DigestOf(text.substr(0, num_signed)) != text.substr(num_signed)) {
    throw InputError(name + kIsDamaged);
  }
  VocabularyTree tree;
  tree.direct_level = header.direct_level;
  tree.origin.resize(header.origin_bytes);
  reader.Take(tree.origin.data(), header.origin_bytes);
  reader.TakeAll(tree.num_children, header.num_nodes);
  reader.TakeAll(tree.centers, header.num_nodes);
  reader.TakeAll(tree.idf, header.num_words);
  if (!tree.Check()) throw InputError(name + kIsDamaged);
  return tree;
}

}  // namespace

std::shared_ptr<const Vocabulary> Vocabulary::Load(const std::string& path) {
  return std::make_shared<const Vocabulary>(Decode(ReadFile(path), "vocabulary " + path));
}

void Vocabulary::Save(const std::string& path) const { WriteFile(path, Encode(tree_)); }

}  // namespace tessera
