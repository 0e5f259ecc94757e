// A vocabulary of binary words: a tree that sorts any descriptor to one of its leaves, the words (Nister and Stewenius
// 2006, for binary descriptors Galvez-Lopez and Tardos 2012).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "features/feature_types.h"
#include "place_recognition/bag_of_words.h"

namespace tessera {

// The content of a vocabulary. Nodes are listed level by level, the root first, each level in the order of its parents;
// so the children of a node are consecutive, and the numbers of children define the shape.
struct VocabularyTree {
  static constexpr int32_t kMaxChildren = 255;

  std::vector<uint8_t> num_children;  // of each node; 0: it is a word
  std::vector<Descriptor> centers;    // of each node; the root's is not used
  std::vector<float> idf;    // of each word, in the order of their nodes: ln(images / images that hold the word)
  int32_t direct_level = 0;  // the level of the direct index; the root is level 0
  std::string origin;        // for people: the training images and options

  bool operator==(const VocabularyTree&) const = default;
  // Fails unless the lists form one tree with a weight for each word.
  Result<> Check() const;
};

class Vocabulary {
 public:
  // Throws std::invalid_argument with tree.Check()'s sentence.
  explicit Vocabulary(VocabularyTree tree);

  // Reads a file that Save wrote. Throws InputError if it is missing, no vocabulary, of another version, truncated or
  // damaged.
  static std::shared_ptr<const Vocabulary> Load(const std::string& path);
  // As WriteFile: there is never half a vocabulary under this name. Throws InputError if it can't be written.
  void Save(const std::string& path) const;

  // The image's bag, keypoint i being the one of descriptors[i]. The weight of a word is
  //
  //   w = n idf / sum over words of n idf,   n: descriptors of this word (tf-idf; the image's number of them cancels).
  //
  // From level to level a descriptor goes to the nearest child by Hamming distance, of equals the first. A word that
  // every training image contains carries no information and is left out.
  BagOfWords Describe(const std::vector<Descriptor>& descriptors) const;

  int32_t num_words() const { return static_cast<int32_t>(tree_.idf.size()); }
  const VocabularyTree& tree() const { return tree_; }

 private:
  struct Leaf {
    int32_t word;
    int32_t direct_node;  // the node on the way that is in the direct index's level, or the leaf itself if above it
  };
  size_t NearestChild(size_t node, const Descriptor& descriptor) const;
  std::vector<Leaf> FindLeaves(const std::vector<Descriptor>& descriptors) const;

  VocabularyTree tree_;
  std::vector<int32_t> first_child_;  // by node; of a word: its number
};

}  // namespace tessera
