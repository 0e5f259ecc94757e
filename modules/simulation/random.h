// Random numbers that depend on their arguments alone, made of integers and exact float operations, so that a world is
// the same, bit for bit, on every machine.
#pragma once

#include <cstdint>
#include <initializer_list>

namespace tessera {

// Mixes four numbers into one whose bits look independent (the finalizer of MurmurHash3, chained).
inline uint32_t HashOf(uint32_t a, uint32_t b = 0, uint32_t c = 0, uint32_t d = 0) {
  uint32_t h = 0x9e3779b9U;
  for (const uint32_t word : {a, b, c, d}) {
    h ^= word + 0x7f4a7c15U + (h << 6) + (h >> 2);
    h ^= h >> 16;
    h *= 0x85ebca6bU;
    h ^= h >> 13;
    h *= 0xc2b2ae35U;
    h ^= h >> 16;
  }
  return h;
}

// Maps a hash to [0, 1).
inline float UnitOf(uint32_t hash) { return static_cast<float>(hash >> 8) * (1.0F / 16777216.0F); }

// About normal, standard deviation 1: the sum of a hash's four bytes, whose deviation is sqrt(4 (256^2 - 1) / 12).
inline float NormalOf(uint32_t hash) {
  const auto sum = static_cast<int>((hash & 255) + ((hash >> 8) & 255) + ((hash >> 16) & 255) + (hash >> 24));
  return static_cast<float>(sum - 510) * (1.0F / 147.8F);
}

// A sequence of random numbers. Draw at most one in an expression: C++ leaves open in which order arguments and
// operands are evaluated (in braces it is from left to right).
class Random {
 public:
  explicit Random(uint32_t seed) : seed_(seed) {}

  uint32_t Next() { return HashOf(seed_, count_++); }
  // In [low, high).
  double Uniform(double low, double high) { return low + (high - low) * static_cast<double>(UnitOf(Next())); }
  // In 0 .. n - 1; n > 0.
  int Index(int n) { return static_cast<int>((static_cast<uint64_t>(Next()) * static_cast<uint64_t>(n)) >> 32); }
  bool Chance(double probability) { return Uniform(0.0, 1.0) < probability; }

 private:
  uint32_t seed_;
  uint32_t count_ = 0;
};

// A wave like a sine of period 1, of parabolas: exact arithmetic, the same on every machine.
double Wave(double x);
// 0 to 1 for t from 0 to 1, slow at both ends.
inline double Ease(double t) { return t <= 0.0 ? 0.0 : (t >= 1.0 ? 1.0 : t * t * (3.0 - 2.0 * t)); }
// Smooth noise in [-1, 1] over a line with about one extremum per unit; equal arguments give equal values.
double SmoothNoise(uint32_t seed, double x);
// Smooth noise in [0, 1] over the plane, one random value per unit square's corner.
float PlaneNoise(uint32_t seed, float x, float y);
// Sum of `octaves` plane noises, each twice as fine and weighted by `gain` of the one before; in [0, 1].
float FractalNoise(uint32_t seed, float x, float y, int octaves, float gain = 0.5F);

}  // namespace tessera
