#include "place_recognition/vocabulary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <stdexcept>

#include "place_recognition/vocabulary_training.h"
#include "support/planted_descriptors.h"

namespace tessera {
namespace {

class VocabularyTest : public testing::Test {
 protected:
  static const Vocabulary& Random() {
    static const Vocabulary vocabulary = [] {
      std::vector<std::vector<Descriptor>> images;
      for (uint64_t i = 0; i < 20; ++i) images.push_back(RandomDescriptors(100, 100 + i));
      return Vocabulary(TrainVocabulary(images, {.num_children = 5, .num_levels = 3, .direct_level = 2}));
    }();
    return vocabulary;
  }
};

double SumOfWeights(const BagOfWords& bag) {
  double sum = 0.0;
  for (const auto& [word, weight] : bag.words) sum += static_cast<double>(weight);
  return sum;
}

TEST_F(VocabularyTest, BagsAreNormalizedAndSorted) {
  const BagOfWords bag = Random().Describe(RandomDescriptors(200, 1));
  EXPECT_NEAR(SumOfWeights(bag), 1.0, 1e-6);
  for (size_t i = 0; i < bag.words.size(); ++i) {
    EXPECT_GT(bag.words[i].second, 0.0F);
    EXPECT_TRUE(i == 0 || bag.words[i - 1].first < bag.words[i].first);
    EXPECT_LT(bag.words[i].first, Random().num_words());
  }
}

TEST_F(VocabularyTest, DirectIndexHoldsEveryKeypointOnce) {
  constexpr size_t kNumDescriptors = 200;
  const BagOfWords bag = Random().Describe(RandomDescriptors(kNumDescriptors, 1));
  std::set<int32_t> seen;
  for (size_t i = 0; i < bag.nodes.size(); ++i) {
    EXPECT_TRUE(i == 0 || bag.nodes[i - 1].first < bag.nodes[i].first);
    EXPECT_TRUE(std::is_sorted(bag.nodes[i].second.begin(), bag.nodes[i].second.end()));
    seen.insert(bag.nodes[i].second.begin(), bag.nodes[i].second.end());
  }
  EXPECT_EQ(seen.size(), kNumDescriptors);
  EXPECT_LE(bag.nodes.size(), 25U);  // level 2 of a tree of 5 children
  EXPECT_GT(bag.nodes.size(), 5U);
}

TEST_F(VocabularyTest, OrderOfDescriptorsChangesNoWord) {
  std::vector<Descriptor> descriptors = RandomDescriptors(200, 1);
  const BagOfWords bag = Random().Describe(descriptors);
  std::reverse(descriptors.begin(), descriptors.end());
  EXPECT_EQ(Random().Describe(descriptors).words, bag.words);
}

TEST_F(VocabularyTest, SimilarityIsSymmetricAndBounded) {
  const BagOfWords empty = Random().Describe({});
  for (uint64_t i = 0; i < 10; ++i) {
    const BagOfWords a = Random().Describe(RandomDescriptors(150, 10 + i));
    const BagOfWords b = Random().Describe(RandomDescriptors(50, 30 + i));
    EXPECT_EQ(Similarity(a, b), Similarity(b, a));
    EXPECT_GE(Similarity(a, b), 0.0);
    EXPECT_LT(Similarity(a, b), 1.0);
    EXPECT_NEAR(Similarity(a, a), 1.0, 1e-6);
    EXPECT_LE(Similarity(a, a), 1.0);
    EXPECT_EQ(Similarity(a, empty), 0.0);
  }
}

TEST_F(VocabularyTest, SimilarityIsOneMinusHalfTheL1Distance) {
  const BagOfWords a{.words = {{1, 0.5F}, {2, 0.25F}, {7, 0.25F}}, .nodes = {}};
  const BagOfWords b{.words = {{2, 0.75F}, {7, 0.125F}, {9, 0.125F}}, .nodes = {}};
  EXPECT_DOUBLE_EQ(Similarity(a, b), 1.0 - 0.5 * (0.5 + 0.5 + 0.125 + 0.125));
}

TEST_F(VocabularyTest, MoreSharedDescriptorsAreMoreAlike) {
  const std::vector<Descriptor> image = RandomDescriptors(200, 1);
  const BagOfWords whole = Random().Describe(image);
  double previous = 0.0;
  for (const size_t num_shared : {0U, 50U, 100U, 150U, 200U}) {
    std::vector<Descriptor> other = RandomDescriptors(200, 2);
    std::copy_n(image.begin(), num_shared, other.begin());
    const double score = Similarity(whole, Random().Describe(other));
    EXPECT_GT(score, previous);
    previous = score;
  }
}

TEST(Vocabulary, WeightsAreTfIdf) {
  const std::vector<Descriptor> d = RandomDescriptors(3, 1);
  const Vocabulary vocabulary({.num_children = {3, 0, 0, 0},
                               .centers = {Descriptor{}, d[0], d[1], d[2]},
                               .idf = {1.0F, 3.0F, 0.0F},
                               .direct_level = 1,
                               .origin = ""});
  const BagOfWords bag = vocabulary.Describe({d[1], d[0], d[2], d[0], d[2]});
  const std::vector<std::pair<int32_t, float>> words = {{0, 0.4F}, {1, 0.6F}};  // of the third nothing can be learnt
  const std::vector<std::pair<int32_t, std::vector<int32_t>>> nodes = {{1, {1, 3}}, {2, {0}}, {3, {2, 4}}};
  EXPECT_EQ(bag.words, words);
  EXPECT_EQ(bag.nodes, nodes);
}

TEST(Vocabulary, OfEquallyNearChildrenTheFirstIsTaken) {
  const Vocabulary vocabulary({.num_children = {2, 0, 0},
                               .centers = {Descriptor{}, Descriptor{1}, Descriptor{2}},
                               .idf = {1.0F, 1.0F},
                               .direct_level = 0,
                               .origin = ""});
  const BagOfWords bag = vocabulary.Describe({Descriptor{3}, Descriptor{0}});
  ASSERT_EQ(bag.words.size(), 1U);
  EXPECT_EQ(bag.words[0].first, 0);
  ASSERT_EQ(bag.nodes.size(), 1U);
  EXPECT_EQ(bag.nodes[0].first, 0);  // level 0 is the root
}

TEST(Vocabulary, RefusesWhatIsNoTree) {
  const VocabularyTree good{.num_children = {2, 0, 0}, .centers = {{}, {1}, {2}}, .idf = {1.0F, 1.0F}};
  EXPECT_TRUE(good.Check());
  const auto refuses = [&](const auto& spoil) {
    VocabularyTree bad = good;
    spoil(bad);
    EXPECT_FALSE(bad.Check());
    EXPECT_THROW(Vocabulary{bad}, std::invalid_argument);
  };
  refuses([](VocabularyTree& tree) { tree = {}; });
  refuses([](VocabularyTree& tree) { tree.centers.pop_back(); });
  refuses([](VocabularyTree& tree) { tree.idf.pop_back(); });
  refuses([](VocabularyTree& tree) { tree.num_children = {1, 0, 0}; });
  refuses([](VocabularyTree& tree) { tree.num_children = {3, 0, 0}; });
  refuses([](VocabularyTree& tree) { tree.num_children = {0, 2, 0}; });
  refuses([](VocabularyTree& tree) { tree.idf[0] = -1.0F; });
  refuses([](VocabularyTree& tree) { tree.idf[0] = std::numeric_limits<float>::quiet_NaN(); });
  refuses([](VocabularyTree& tree) { tree.direct_level = -1; });
}

}  // namespace
}  // namespace tessera
