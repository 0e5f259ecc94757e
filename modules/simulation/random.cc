#include "simulation/random.h"

#include <cmath>

namespace tessera {
namespace {

// 0 at 0, 1 at 1, flat at both.
template <class Real>
Real Ease(Real t) {
  return t * t * (Real(3) - Real(2) * t);
}

float CornerValue(uint32_t seed, int x, int y) {
  return UnitOf(HashOf(seed, static_cast<uint32_t>(x), static_cast<uint32_t>(y)));
}

}  // namespace

double Wave(double x) {
  const double t = x - std::floor(x);
  return t < 0.5 ? 16.0 * t * (0.5 - t) : -16.0 * (t - 0.5) * (1.0 - t);
}

double SmoothNoise(uint32_t seed, double x) {
  const double floor = std::floor(x);
  const auto cell = static_cast<uint32_t>(static_cast<int64_t>(floor));
  const auto value = [seed](uint32_t at) { return 2.0 * static_cast<double>(UnitOf(HashOf(seed, at))) - 1.0; };
  const double from = value(cell);
  return from + Ease(x - floor) * (value(cell + 1) - from);
}

float PlaneNoise(uint32_t seed, float x, float y) {
  const float floor_x = std::floor(x);
  const float floor_y = std::floor(y);
  const int cell_x = static_cast<int>(floor_x);
  const int cell_y = static_cast<int>(floor_y);
  const float across = Ease(x - floor_x);
  const float along = Ease(y - floor_y);
  const float top_left = CornerValue(seed, cell_x, cell_y);
  const float bottom_left = CornerValue(seed, cell_x, cell_y + 1);
  const float top = top_left + across * (CornerValue(seed, cell_x + 1, cell_y) - top_left);
  const float bottom = bottom_left + across * (CornerValue(seed, cell_x + 1, cell_y + 1) - bottom_left);
  return top + along * (bottom - top);
}

float FractalNoise(uint32_t seed, float x, float y, int octaves, float gain) {
  float sum = 0.0F;
  float weight = 1.0F;
  float total = 0.0F;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * PlaneNoise(seed + static_cast<uint32_t>(octave), x, y);
    total += weight;
    weight *= gain;
    x *= 2.0F;
    y *= 2.0F;
  }
  return sum / total;
}

}  // namespace tessera
