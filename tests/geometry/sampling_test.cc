#include "geometry/sampling.h"

#include <gmock/gmock.h>

#include <set>
#include <vector>

namespace tessera {
namespace {

std::vector<std::array<size_t, 3>> Samples(uint64_t seed, size_t population, int num_samples) {
  std::vector<std::array<size_t, 3>> samples;
  ForEachSample<3>(seed, population, num_samples, [&](const auto& sample) { samples.push_back(sample); });
  return samples;
}

TEST(ForEachSample, AllIndicesOfASampleDifferAndLieInThePopulation) {
  for (const auto& sample : Samples(1, 4, 1000)) {
    EXPECT_EQ(std::set<size_t>(sample.begin(), sample.end()).size(), 3U);
    for (const size_t index : sample) EXPECT_LT(index, 4U);
  }
}

TEST(ForEachSample, MeetsTheWholePopulation) {
  std::set<size_t> met;
  for (const auto& sample : Samples(2, 50, 200)) met.insert(sample.begin(), sample.end());
  EXPECT_EQ(met.size(), 50U);
}

TEST(ForEachSample, TheSeedDecidesTheSamples) {
  EXPECT_EQ(Samples(7, 100, 20), Samples(7, 100, 20));
  EXPECT_NE(Samples(7, 100, 20), Samples(8, 100, 20));
  EXPECT_TRUE(Samples(7, 100, 0).empty());
}

// The generator is fixed by the standard, so these are the first samples on every machine.
TEST(ForEachSample, DrawsFromTheStandardGenerator) {
  std::mt19937_64 generator(5);
  const auto first = SampleDistinct<3>(generator, 1000), second = SampleDistinct<3>(generator, 1000);
  EXPECT_THAT(Samples(5, 1000, 2), testing::ElementsAre(first, second));
}

}  // namespace
}  // namespace tessera
