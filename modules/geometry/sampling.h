// Random samples that are the same on every machine: the standard fixes std::mt19937_64, but not its distributions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>

namespace tessera {

// kCount different indices out of 0 .. population - 1; population >= kCount.
template <int kCount>
std::array<size_t, kCount> SampleDistinct(std::mt19937_64& generator, size_t population) {
  std::array<size_t, kCount> sample;
  for (size_t k = 0; k < kCount;) {
    sample[k] = static_cast<size_t>(generator() % population);
    bool is_new = true;
    for (size_t j = 0; j < k; ++j) {
      is_new = is_new && sample[j] != sample[k];
    }
    k += is_new ? 1 : 0;
  }
  return sample;
}

// The loop of RANSAC: calls visit(indices) for `num_samples` samples of kCount different indices out of
// 0 .. population - 1. `seed` decides them.
template <int kCount, class Visit>
void ForEachSample(uint64_t seed, size_t population, int num_samples, Visit visit) {
  std::mt19937_64 generator(seed);
  for (int i = 0; i < num_samples; ++i) visit(SampleDistinct<kCount>(generator, population));
}

}  // namespace tessera
