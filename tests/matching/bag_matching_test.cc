#include "matching/bag_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "place_recognition/vocabulary.h"
#include "support/planted_descriptors.h"

namespace tessera {
namespace {

bool UseAll(int32_t) { return true; }

// Two images of the same 200 corners: the second in another order, with noise, turned by a sixth.
class TwoImages : public testing::Test {
 protected:
  static constexpr size_t kNum = 200;
  static constexpr uint8_t kTurn = 42;

  TwoImages() : second_of_(kNum) {
    std::iota(second_of_.begin(), second_of_.end(), 0);
    std::shuffle(second_of_.begin(), second_of_.end(), generator_);
    first_.descriptors = RandomDescriptors(kNum, 1);
    first_.keypoints.resize(kNum);
    second_ = first_;
    for (size_t i = 0; i < kNum; ++i) {
      first_.keypoints[i].angle = static_cast<uint8_t>(generator_());
      const auto j = static_cast<size_t>(second_of_[i]);
      second_.descriptors[j] = Perturb(first_.descriptors[i], 20, generator_);
      second_.keypoints[j].angle = static_cast<uint8_t>(first_.keypoints[i].angle + kTurn);
      const auto node = static_cast<int32_t>(i % 3);
      Put(node, static_cast<int32_t>(i), first_bag_);
      Put(node, second_of_[i], second_bag_);
    }
    for (auto& [node, keypoints] : second_bag_.nodes) std::sort(keypoints.begin(), keypoints.end());
  }

  static void Put(int32_t node, int32_t keypoint, BagOfWords& bag) {
    for (int32_t n = static_cast<int32_t>(bag.nodes.size()); n <= node; ++n) bag.nodes.push_back({n, {}});
    bag.nodes[static_cast<size_t>(node)].second.push_back(keypoint);
  }
  std::vector<KeypointPair> Match(const BagMatchingOptions& options = {}) const {
    return MatchByBags(first_, first_bag_, UseAll, second_, second_bag_, UseAll, options);
  }
  size_t NumRight(const std::vector<KeypointPair>& pairs) const {
    return static_cast<size_t>(std::count_if(pairs.begin(), pairs.end(), [&](const KeypointPair& pair) {
      return second_of_[static_cast<size_t>(pair.first)] == pair.second;
    }));
  }

  std::mt19937_64 generator_{3};
  std::vector<int32_t> second_of_;  // by keypoint of the first
  FeatureFrame first_, second_;
  BagOfWords first_bag_, second_bag_;
};

TEST_F(TwoImages, EveryCornerFindsItself) {
  const std::vector<KeypointPair> pairs = Match();
  EXPECT_EQ(pairs.size(), kNum);
  EXPECT_EQ(NumRight(pairs), kNum);
  for (size_t k = 1; k < pairs.size(); ++k) EXPECT_LT(pairs[k - 1].first, pairs[k].first);
}

TEST_F(TwoImages, OnlyKeypointsThatTakePartAreMatched) {
  const auto pairs = MatchByBags(
      first_, first_bag_, [](int32_t i) { return i < 50; }, second_, second_bag_, [](int32_t j) { return j % 2 == 0; },
      {});
  size_t num_expected = 0;
  for (size_t i = 0; i < 50; ++i) num_expected += second_of_[i] % 2 == 0 ? 1U : 0U;
  EXPECT_EQ(pairs.size(), num_expected);
  EXPECT_EQ(NumRight(pairs), num_expected);
}

TEST_F(TwoImages, KeypointsOfOtherNodesAreNotAsked) {
  for (auto& [node, keypoints] : second_bag_.nodes) node += 1;
  EXPECT_TRUE(Match().empty());
  second_bag_.nodes.clear();
  EXPECT_TRUE(Match().empty());
}

TEST_F(TwoImages, WhatIsTooFarOrNotClearIsNoMatch) {
  EXPECT_TRUE(Match({.max_hamming = 2}).empty());
  // A second corner that looks like corner 0 of the second image makes it ambiguous.
  const auto twin = static_cast<size_t>(second_of_[3]);
  second_.descriptors[twin] = second_.descriptors[static_cast<size_t>(second_of_[0])];
  for (const KeypointPair& pair : Match()) EXPECT_NE(pair.first, 0);
}

TEST_F(TwoImages, OfTwoClaimsTheNearerWins) {
  // Keypoint 3 of the first image looks like keypoint 0, but less so; both are of one node.
  first_.descriptors[3] = first_.descriptors[0];
  first_.descriptors[3][0] ^= 0xFFFFULL;  // 16 bits
  const std::vector<KeypointPair> pairs = Match();
  std::vector<int32_t> used;
  bool has_first = false;
  for (const KeypointPair& pair : pairs) {
    used.push_back(pair.second);
    has_first |= pair.first == 0 && pair.second == second_of_[0];
    EXPECT_NE(pair.first, 3);
  }
  EXPECT_TRUE(has_first);
  std::sort(used.begin(), used.end());
  EXPECT_EQ(std::adjacent_find(used.begin(), used.end()), used.end()) << "a keypoint stands in two pairs";
}

TEST_F(TwoImages, PairsThatTurnUnlikeTheOthersAreDropped) {
  for (size_t i = 0; i < 20; ++i) {
    second_.keypoints[static_cast<size_t>(second_of_[i])].angle =
        static_cast<uint8_t>(first_.keypoints[i].angle + kTurn + 100);
  }
  const std::vector<KeypointPair> pairs = Match();
  EXPECT_EQ(pairs.size(), kNum - 20);
  for (const KeypointPair& pair : pairs) EXPECT_GE(pair.first, 20);
}

// With the vocabulary's nodes noise sorts some corners elsewhere; most are found, and no wrong ones.
TEST_F(TwoImages, TheShippedVocabularySortsMostAlike) {
  const auto vocabulary = Vocabulary::Load(TESSERA_SOURCE_DIR "/config/vocabulary.tvoc");
  const auto pairs = MatchByBags(first_, vocabulary->Describe(first_.descriptors), UseAll, second_,
                                 vocabulary->Describe(second_.descriptors), UseAll, {});
  EXPECT_GT(pairs.size(), kNum / 4);
  EXPECT_EQ(NumRight(pairs), pairs.size());
}

}  // namespace
}  // namespace tessera
