// Learns a vocabulary from the descriptors of many images.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/result.h"
#include "place_recognition/vocabulary.h"

namespace tessera {

struct VocabularyOptions {
  int num_children = 10;        // into which a node is split: k; finding a word takes k comparisons a level
  int num_levels = 5;           // below the root: at most k^5 = 100000 words, as many as 4 MB hold
  int direct_level = 2;         // of the direct index: k^2 = 100 nodes, 20 keypoints of an image's 2000 in each
  int max_num_iterations = 10;  // of each split; later ones move few descriptors
  uint64_t seed = 1;            // of the choice of the first centers

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Hierarchical k-medians in Hamming space (k-majority, Grana et al. 2013): the descriptors of a node are split around k
// centers by repeating
//
//   each descriptor goes to the nearest center;   each bit of a center becomes that of the majority of its descriptors,
//
// until nothing changes, and each part is split in turn. The first centers are chosen as in k-means++ (Arthur and
// Vassilvitskii 2007), the best of a few drawn with probabilities proportional to the squared distance from the nearest
// center so far. The tree is a pure function of its arguments. images[i]: the descriptors of one image; idf counts the
// images that hold a word. Throws std::invalid_argument with options.Check()'s sentence, or if there are no
// descriptors.
VocabularyTree TrainVocabulary(const std::vector<std::vector<Descriptor>>& images, const VocabularyOptions& options);

}  // namespace tessera
