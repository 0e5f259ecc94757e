// Paint of a motorway.
#include <algorithm>
#include <cmath>

#include "simulation/canvas.h"
#include "simulation/highway.h"
#include "simulation/paint.h"
#include "simulation/street_map.h"

namespace tessera {
namespace {

constexpr double kGrassM = 1.9;  // in the middle

uint8_t ToGray(double value) { return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)); }
double Stain(uint32_t seed, int x, int y) { return static_cast<double>(StainAt(seed, x, y)); }
double Speckle(uint32_t seed, int x, int y) { return static_cast<double>(SpeckleAt(seed, x, y)); }

bool IsLine(const StreetPosition& position) {
  constexpr double kHalfM = 0.09, kDashM = 4.0, kPeriodM = 12.0;
  const double side = std::abs(position.lateral_m);
  const bool is_dash = position.along_m - kPeriodM * std::floor(position.along_m / kPeriodM) < kDashM;
  return std::abs(side - kInnerLineM) < kHalfM || std::abs(side - kOuterLineM) < kHalfM ||
         (is_dash && std::abs(side - kInnerLineM - kLaneWidthM) < kHalfM);
}

double HighwayTone(const StreetPosition& position, uint32_t seed, int x, int y) {
  const double side = std::abs(position.lateral_m);
  if (side < kGrassM || side > kHardShoulderM + 0.1 * Stain(HashOf(seed, 7), x, y)) {
    return 86.0 + 20.0 * Speckle(seed, x, y) + 14.0 * Stain(HashOf(seed, 2), x, y);
  }
  if (IsLine(position)) return 190.0 + 8.0 * Speckle(seed, x, y);
  const double in_lane = std::min(std::abs(side - kLeftLaneM), std::abs(side - kRightLaneM));
  const double track = std::abs(in_lane - 0.8) < 0.3 ? -5.0 : 0.0;
  // Every fifth or so stretch of 60 m was repaired.
  const bool is_mended = HashOf(seed, static_cast<uint32_t>(static_cast<int>(position.along_m / 60.0))) % 5 == 0;
  const double repair = is_mended && Stain(HashOf(seed, 5), x / 5, y / 5) > 0.5 ? -11.0 : 0.0;
  return 104.0 + track + repair + 8.0 * Speckle(seed, x, y) + 5.0 * Stain(HashOf(seed, 6), x / 2, y / 2);
}

}  // namespace

Texture PaintHighway(const PaintSpec& spec, const StreetMap& map) {
  return PaintAlongStreet(spec, map, [&](const StreetPosition& position, int x, int y) {
    return ToGray(HighwayTone(position, spec.seed, x, y));
  });
}

Texture PaintNoiseBarrier(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 118.0, {5.0, 7.0});
  for (double y = 0.5; y < spec.height_m; y += 0.5) canvas.Fill({0.0, y, spec.width_m, 0.04}, 88.0);
  canvas.Fill({0.0, 0.0, 0.12, spec.height_m}, 60.0);
  canvas.Fill({spec.width_m - 0.12, 0.0, 0.12, spec.height_m}, 60.0);
  return MakeTexture(std::move(canvas.image()), {});
}

}  // namespace tessera
