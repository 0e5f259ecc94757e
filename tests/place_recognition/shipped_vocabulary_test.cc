// The vocabulary that comes with the project.
#include <gtest/gtest.h>

#include "place_recognition/vocabulary.h"
#include "support/planted_descriptors.h"

namespace tessera {
namespace {

constexpr const char* kPath = TESSERA_SOURCE_DIR "/config/vocabulary.tvoc";

TEST(ShippedVocabulary, LoadsAndSaysWhatItWasTrainedOn) {
  const auto vocabulary = Vocabulary::Load(kPath);
  EXPECT_GT(vocabulary->num_words(), 50000);
  EXPECT_NE(vocabulary->tree().origin.find("images"), std::string::npos);
}

TEST(ShippedVocabulary, TellsNoisyCopiesFromOthers) {
  const auto vocabulary = Vocabulary::Load(kPath);
  // The vocabulary's own words stand for what real images hold.
  const std::vector<Descriptor>& centers = vocabulary->tree().centers;
  std::mt19937_64 generator(1);
  std::vector<Descriptor> image, again, other;
  for (int i = 0; i < 1000; ++i) {
    const Descriptor& center = centers[centers.size() - 1 - generator() % (centers.size() / 2)];
    image.push_back(Perturb(center, 10, generator));
    again.push_back(Perturb(image.back(), 10, generator));
    other.push_back(Perturb(centers[centers.size() - 1 - generator() % (centers.size() / 2)], 10, generator));
  }
  const BagOfWords bag = vocabulary->Describe(image);
  EXPECT_GT(Similarity(bag, vocabulary->Describe(again)), 5.0 * Similarity(bag, vocabulary->Describe(other)));
}

}  // namespace
}  // namespace tessera
