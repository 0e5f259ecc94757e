#include "place_recognition/vocabulary_training.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>

#include "support/planted_descriptors.h"

namespace tessera {
namespace {

// Images that hold one noisy copy of each center.
std::vector<std::vector<Descriptor>> ImagesAround(const std::vector<Descriptor>& centers, int num_images,
                                                  int num_flips) {
  std::mt19937_64 generator(99);
  std::vector<std::vector<Descriptor>> images(static_cast<size_t>(num_images));
  for (auto& image : images) {
    for (const Descriptor& center : centers) image.push_back(Perturb(center, num_flips, generator));
  }
  return images;
}

TEST(VocabularyTraining, FindsPlantedClusters) {
  const std::vector<Descriptor> planted = RandomDescriptors(8, 1);
  const VocabularyTree tree =
      TrainVocabulary(ImagesAround(planted, 41, 20), {.num_children = 8, .num_levels = 1, .direct_level = 0});
  ASSERT_EQ(tree.num_children.size(), 9U);
  // Each center is the majority of 41 copies, in each of which a bit is wrong with a chance of 20 in 256.
  const std::set<Descriptor> found(tree.centers.begin() + 1, tree.centers.end());
  EXPECT_EQ(found, std::set<Descriptor>(planted.begin(), planted.end()));
}

TEST(VocabularyTraining, FindsClustersOfClusters) {
  const std::vector<Descriptor> coarse = RandomDescriptors(4, 2);
  std::mt19937_64 generator(3);
  std::vector<Descriptor> fine;
  for (const Descriptor& center : coarse) {
    for (int i = 0; i < 4; ++i) fine.push_back(Perturb(center, 40, generator));
  }
  const Vocabulary vocabulary(
      TrainVocabulary(ImagesAround(fine, 31, 4), {.num_children = 4, .num_levels = 2, .direct_level = 1}));
  EXPECT_EQ(vocabulary.num_words(), 16);
  // Each fine cluster has its word, and the direct index brings together what belongs to one coarse cluster.
  const BagOfWords bag = vocabulary.Describe(fine);
  ASSERT_EQ(bag.nodes.size(), 4U);
  for (const auto& [node, keypoints] : bag.nodes) {
    ASSERT_EQ(keypoints.size(), 4U);
    for (const int32_t keypoint : keypoints) EXPECT_EQ(keypoint / 4, keypoints[0] / 4);
  }
}

TEST(VocabularyTraining, SameArgumentsGiveTheSameTreeAndAnotherSeedAnother) {
  const std::vector<std::vector<Descriptor>> images = {RandomDescriptors(300, 4), RandomDescriptors(300, 5)};
  const VocabularyOptions options{.num_children = 5, .num_levels = 3};
  EXPECT_EQ(TrainVocabulary(images, options), TrainVocabulary(images, options));
  VocabularyOptions other_seed = options;
  other_seed.seed = 2;
  EXPECT_NE(TrainVocabulary(images, options), TrainVocabulary(images, other_seed));
}

TEST(VocabularyTraining, WeighsAWordByHowFewImagesHoldIt) {
  const std::vector<Descriptor> d = RandomDescriptors(3, 6);
  const std::vector<std::vector<Descriptor>> images = {{d[0], d[1]}, {d[0], d[1]}, {d[0], d[2], d[2]}, {d[0]}};
  const Vocabulary vocabulary(TrainVocabulary(images, {.num_children = 3, .num_levels = 1, .direct_level = 1}));
  ASSERT_EQ(vocabulary.num_words(), 3);
  const VocabularyTree& tree = vocabulary.tree();
  const auto idf_of = [&](const Descriptor& descriptor) {
    const auto found = std::find(tree.centers.begin() + 1, tree.centers.end(), descriptor);
    return tree.idf.at(static_cast<size_t>(found - tree.centers.begin()) - 1);
  };
  EXPECT_FLOAT_EQ(idf_of(d[0]), 0.0F);
  EXPECT_FLOAT_EQ(idf_of(d[1]), std::log(2.0F));
  EXPECT_FLOAT_EQ(idf_of(d[2]), std::log(4.0F));
}

TEST(VocabularyTraining, EqualDescriptorsMakeOneWord) {
  const std::vector<Descriptor> one = RandomDescriptors(1, 7);
  const VocabularyTree tree = TrainVocabulary({{one[0], one[0]}, {one[0]}}, VocabularyOptions{});
  EXPECT_EQ(tree.num_children, std::vector<uint8_t>{0});
  EXPECT_TRUE(tree.Check());
}

TEST(VocabularyTraining, RefusesBadOptionsAndNothingToLearnFrom) {
  const std::vector<std::vector<Descriptor>> images = {RandomDescriptors(10, 8)};
  EXPECT_THROW(TrainVocabulary(images, {.num_children = 1}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary(images, {.num_children = 256}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary(images, {.num_levels = 0}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary(images, {.num_levels = 2, .direct_level = 3}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary(images, {.max_num_iterations = 0}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary({}, VocabularyOptions{}), std::invalid_argument);
  EXPECT_THROW(TrainVocabulary({{}, {}}, VocabularyOptions{}), std::invalid_argument);
}

}  // namespace
}  // namespace tessera
