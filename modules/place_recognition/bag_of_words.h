// An image as a bag of visual words, and how alike two such bags are.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace tessera {

// What Vocabulary::Describe makes of an image's descriptors.
struct BagOfWords {
  // (word, weight): each word once, ascending; weights are > 0 and sum up to 1.
  std::vector<std::pair<int32_t, float>> words;
  // The direct index, for guided matching: (node, keypoints below it), the nodes being those of one middle level of the
  // tree; ascending, and so are the keypoints of each. Every keypoint is in exactly one.
  std::vector<std::pair<int32_t, std::vector<int32_t>>> nodes;

  bool operator==(const BagOfWords&) const = default;
};

// How alike two images are, 0..1 (Nister and Stewenius 2006; Galvez-Lopez and Tardos 2012):
//
//   s(a, b) = 1 - 1/2 |a - b|_1 = sum over common words of min(a_w, b_w),
//
// the second since both sum up to 1. Added in order of the words, so s(a, b) and s(b, a) are the same bit for bit.
// 0 if either is empty.
double Similarity(const BagOfWords& a, const BagOfWords& b);

}  // namespace tessera
