// Vocabularies of place recognition. The digest at the end of a file is made right, since no mutation would guess it.
//
// Input: the file without its digest.
#include <array>
#include <fstream>
#include <iterator>

#include "core/sha256.h"
#include "fuzz/fuzz_target.h"
#include "place_recognition/vocabulary.h"

namespace tessera {
namespace {

constexpr size_t kDigestBytes = 64;

// A root with two words below it, or three.
std::string MadeFile(int num_words) {
  const FuzzFolder folder;
  VocabularyTree tree;
  tree.num_children.assign(static_cast<size_t>(num_words) + 1, 0);
  tree.num_children[0] = static_cast<uint8_t>(num_words);
  tree.centers.resize(tree.num_children.size());
  for (size_t i = 0; i < tree.centers.size(); ++i) tree.centers[i].fill(0x0123456789ABCDEFU * i);
  tree.idf.assign(static_cast<size_t>(num_words), 1.5F);
  tree.direct_level = 1;
  tree.origin = "made";
  Vocabulary(tree).Save(folder.path("words"));
  std::ifstream file(folder.path("words"), std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return text.substr(0, text.size() - kDigestBytes);
}

}  // namespace

std::vector<std::string> Seeds() { return {MadeFile(2), MadeFile(3), MadeFile(7)}; }

void Read(std::string_view text) {
  static const FuzzFolder folder;
  Sha256 sha256;
  sha256.Add(text.data(), text.size());
  folder.Write("words", std::string(text) + sha256.HexDigest());
  ExpectSentence([] {
    const auto vocabulary = Vocabulary::Load(folder.path("words"));
    (void)vocabulary->Describe(std::vector<Descriptor>(3, Descriptor{1, 2, 3, 4}));
  });
}

}  // namespace tessera
