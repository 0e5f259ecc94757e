// Which keypoints of two images may show the same point, asked only among those whose descriptors the vocabulary sorts
// alike.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "features/feature_types.h"
#include "place_recognition/bag_of_words.h"

namespace tessera {

struct BagMatchingOptions {
  int max_hamming = 50;     // of 256
  double max_ratio = 0.75;  // best to second best distance
};

struct KeypointPair {
  int32_t first = -1;
  int32_t second = -1;
};

// Pairs by `first`; no keypoint is in two of them. `uses_first` and `uses_second` say which keypoints take part. Of
// claims to one keypoint the nearest descriptor wins, then the lower index; pairs outside the peak of the rotation
// histogram are dropped.
std::vector<KeypointPair> MatchByBags(const FeatureFrame& first, const BagOfWords& first_bag,
                                      const std::function<bool(int32_t)>& uses_first, const FeatureFrame& second,
                                      const BagOfWords& second_bag, const std::function<bool(int32_t)>& uses_second,
                                      const BagMatchingOptions& options);

}  // namespace tessera
