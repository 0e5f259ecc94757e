// Time to load the shipped vocabulary, to describe an image by it, and to ask for places among many keyframes. Images
// are made of noisy copies of the vocabulary's own words.
#include <benchmark/benchmark.h>

#include "place_recognition/place_database.h"
#include "place_recognition/vocabulary.h"
#include "support/planted_descriptors.h"

namespace tessera {
namespace {

constexpr const char* kPath = TESSERA_SOURCE_DIR "/config/vocabulary.tvoc";
constexpr size_t kNumKeypoints = 2000;

const Vocabulary& Shipped() {
  static const std::shared_ptr<const Vocabulary> vocabulary = Vocabulary::Load(kPath);
  return *vocabulary;
}

// The last nodes are words: they stand in the lowest level.
std::vector<Descriptor> MakeImage(uint64_t seed) {
  const std::vector<Descriptor>& centers = Shipped().tree().centers;
  std::mt19937_64 generator(seed);
  std::vector<Descriptor> image;
  for (size_t i = 0; i < kNumKeypoints; ++i) {
    image.push_back(Perturb(centers[centers.size() - 1 - generator() % (centers.size() / 2)], 20, generator));
  }
  return image;
}

void Load(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(Vocabulary::Load(kPath));
}

void Describe(benchmark::State& state) {
  const std::vector<Descriptor> image = MakeImage(1);
  size_t num_words = 0;
  for (auto _ : state) num_words = Shipped().Describe(image).words.size();
  state.counters["words"] = static_cast<double>(num_words);
}

void Query(benchmark::State& state) {
  PlaceDatabase database;
  for (int64_t i = 0; i < state.range(0); ++i) {
    database.Add(KeyframeId{i},
                 std::make_shared<const BagOfWords>(Shipped().Describe(MakeImage(static_cast<uint64_t>(i)))));
  }
  const BagOfWords bag = Shipped().Describe(MakeImage(static_cast<uint64_t>(state.range(0) / 2)));
  const auto accepts = [](KeyframeId) { return true; };
  for (auto _ : state) benchmark::DoNotOptimize(database.Query(bag, accepts));
}

BENCHMARK(Load)->Unit(benchmark::kMillisecond);
BENCHMARK(Describe)->Unit(benchmark::kMillisecond);
BENCHMARK(Query)->Arg(100)->Arg(300)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace tessera
