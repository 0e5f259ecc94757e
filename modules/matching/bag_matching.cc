#include "matching/bag_matching.h"

#include <map>

#include "matching/matching.h"

namespace tessera {
namespace {

struct Claim {
  int32_t first = -1;
  int distance = 257;
};

// Offers each of the node's keypoints of `first` its clear match among those of `second`.
void MatchNode(const FeatureFrame& first, const std::vector<int32_t>& own, const FeatureFrame& second,
               const std::vector<int32_t>& others, const MatchingOptions& options, std::map<int32_t, Claim>& claims) {
  for (const int32_t i : own) {
    BestMatch best;
    for (const int32_t j : others)
      best.Offer(j, HammingDistance(first.descriptors[Index(i)], second.descriptors[Index(j)]));
    if (!best.IsClear(options)) continue;
    Claim& claim = claims[best.index];
    if (best.distance < claim.distance || (best.distance == claim.distance && i < claim.first)) {
      claim = {i, best.distance};
    }
  }
}

std::vector<int32_t> Filter(const std::vector<int32_t>& keypoints, const std::function<bool(int32_t)>& uses) {
  std::vector<int32_t> kept;
  for (const int32_t i : keypoints) {
    if (uses(i)) kept.push_back(i);
  }
  return kept;
}

}  // namespace

std::vector<KeypointPair> MatchByBags(const FeatureFrame& first, const BagOfWords& first_bag,
                                      const std::function<bool(int32_t)>& uses_first, const FeatureFrame& second,
                                      const BagOfWords& second_bag, const std::function<bool(int32_t)>& uses_second,
                                      const BagMatchingOptions& options) {
  const MatchingOptions limits{options.max_hamming, options.max_ratio, false};
  std::map<int32_t, Claim> claims;  // by keypoint of the second image
  auto a = first_bag.nodes.begin();
  auto b = second_bag.nodes.begin();
  while (a != first_bag.nodes.end() && b != second_bag.nodes.end()) {
    if (a->first < b->first) {
      ++a;
    } else if (b->first < a->first) {
      ++b;
    } else {
      MatchNode(first, Filter(a->second, uses_first), second, Filter(b->second, uses_second), limits, claims);
      ++a, ++b;
    }
  }
  std::map<int32_t, int32_t> second_of;  // by first, in its order
  for (const auto& [keypoint, claim] : claims) second_of[claim.first] = keypoint;
  std::vector<KeypointPair> pairs;
  std::vector<uint8_t> rotations;
  for (const auto& [i, j] : second_of) {
    pairs.push_back({i, j});
    rotations.push_back(static_cast<uint8_t>(second.keypoints[Index(j)].angle - first.keypoints[Index(i)].angle));
  }
  const std::vector<char> is_inlier = RotationHistogramInliers(rotations);
  std::vector<KeypointPair> kept;
  for (size_t k = 0; k < pairs.size(); ++k) {
    if (is_inlier[k]) kept.push_back(pairs[k]);
  }
  return kept;
}

}  // namespace tessera
