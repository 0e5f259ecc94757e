// The similarity of two bags of words is the overlap of their weights.
#include "place_recognition/bag_of_words.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

namespace tessera {
namespace {

BagOfWords RandomBag(std::mt19937& generator) {
  std::uniform_real_distribution<float> uniform(0.1F, 1.0F);
  std::map<int32_t, float> weights;
  float sum = 0.0F;
  for (int i = 0; i < 30; ++i) weights[static_cast<int32_t>(generator() % 60)] = uniform(generator);
  for (const auto& [word, weight] : weights) sum += weight;
  BagOfWords bag;
  for (const auto& [word, weight] : weights) bag.words.emplace_back(word, weight / sum);
  return bag;
}

TEST(Similarity, IsOneForEqualBagsAndZeroWithoutCommonWords) {
  const BagOfWords a{{{1, 0.25F}, {4, 0.75F}}, {}}, b{{{2, 0.5F}, {3, 0.5F}}, {}};
  EXPECT_EQ(Similarity(a, a), 1.0);
  EXPECT_EQ(Similarity(a, b), 0.0);
  EXPECT_EQ(Similarity(a, {}), 0.0);
  EXPECT_EQ(Similarity({}, {}), 0.0);
}

TEST(Similarity, AddsTheSmallerWeightOfEachCommonWord) {
  const BagOfWords a{{{1, 0.25F}, {4, 0.75F}}, {}}, b{{{1, 0.5F}, {4, 0.125F}, {9, 0.375F}}, {}};
  EXPECT_EQ(Similarity(a, b), 0.25 + 0.125);
}

// s(a, b) = 1 - 1/2 |a - b|_1, and s(a, b) = s(b, a) bit for bit.
TEST(Similarity, IsSymmetricAndTheL1ScoreOfTheLiterature) {
  std::mt19937 generator(3);
  for (int i = 0; i < 20; ++i) {
    const BagOfWords a = RandomBag(generator), b = RandomBag(generator);
    std::map<int32_t, double> difference;
    for (const auto& [word, weight] : a.words) difference[word] += static_cast<double>(weight);
    for (const auto& [word, weight] : b.words) difference[word] -= static_cast<double>(weight);
    double l1 = 0.0;
    for (const auto& [word, weight] : difference) l1 += std::abs(weight);
    EXPECT_EQ(Similarity(a, b), Similarity(b, a));
    EXPECT_NEAR(Similarity(a, b), 1.0 - 0.5 * l1, 1e-6);
  }
}

}  // namespace
}  // namespace tessera
