// Descriptors around planted centers: what a good clustering of them is, is known.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "features/feature_types.h"

namespace tessera {

// Every bit independent and fair: two of them differ by 128 +- 8 bits.
inline Descriptor RandomDescriptor(std::mt19937_64& generator) {
  Descriptor descriptor;
  for (uint64_t& word : descriptor) word = generator();
  return descriptor;
}

inline std::vector<Descriptor> RandomDescriptors(size_t count, uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::vector<Descriptor> descriptors;
  for (size_t i = 0; i < count; ++i) descriptors.push_back(RandomDescriptor(generator));
  return descriptors;
}

// The descriptor with `num_flips` bits flipped, some perhaps twice.
inline Descriptor Perturb(Descriptor descriptor, int num_flips, std::mt19937_64& generator) {
  for (int i = 0; i < num_flips; ++i) {
    const uint64_t bit = generator() % 256;
    descriptor[bit / 64] ^= uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

}  // namespace tessera
