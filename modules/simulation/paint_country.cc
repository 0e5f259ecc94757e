// Paint of a landscape: a road of little texture, fields, and ridges against the sky.
#include <algorithm>
#include <cmath>

#include "simulation/canvas.h"
#include "simulation/paint.h"
#include "simulation/street_map.h"

namespace tessera {
namespace {

constexpr double kEdgeLineM = 2.95;  // from the road's middle to its white lines
constexpr double kRoadEdgeM = 3.4;
constexpr double kVergeM = 6.0;  // grass between road and field

uint8_t ToGray(double value) { return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)); }
double Stain(uint32_t seed, int x, int y) { return static_cast<double>(StainAt(seed, x, y)); }
double Speckle(uint32_t seed, int x, int y) { return static_cast<double>(SpeckleAt(seed, x, y)); }

double AsphaltTone(const StreetPosition& position, const PaintSpec& spec, int x, int y) {
  const uint32_t seed = spec.seed;
  const double track = std::abs(std::abs(std::abs(position.lateral_m) - 1.6) - 0.75) < 0.3 ? 4.0 : 0.0;
  // Every fourth or so stretch of 40 m was repaired.
  const bool is_mended = HashOf(seed, static_cast<uint32_t>(static_cast<int>(position.along_m / 40.0))) % 4 == 0;
  const double repair = is_mended && Stain(HashOf(seed, 5), x / 5, y / 5) > 0.5 ? -11.0 : 0.0;
  return 98.0 + track + repair +
         spec.roughness * (11.0 * Speckle(seed, x, y) + 6.0 * Stain(HashOf(seed, 6), x / 2, y / 2));
}

double FieldTone(double tone, uint32_t seed, int x, int y) {
  return tone + 4.0 * Speckle(seed, x, y) + 7.0 * Stain(HashOf(seed, 2), x, y);
}

double RoadsideTone(const StreetPosition& position, const PaintSpec& spec, int x, int y) {
  const double side = std::abs(position.lateral_m);
  const double wear = Stain(HashOf(spec.seed, 7), x, y);
  if (std::abs(side - kEdgeLineM) < 0.07 && wear < 0.75) return 190.0 + 6.0 * wear;
  if (side < kRoadEdgeM + 0.12 * wear) return AsphaltTone(position, spec, x, y);
  const double grass =
      84.0 + spec.roughness * (24.0 * Speckle(spec.seed, x, y) + 14.0 * Stain(HashOf(spec.seed, 2), x, y));
  if (side < kVergeM - 1.5) return grass;
  const double part = std::clamp((side - kVergeM + 1.5) / 3.0, 0.0, 1.0);
  return grass + part * (FieldTone(spec.tone, spec.seed, x, y) - grass);
}

}  // namespace

Texture PaintCountryRoad(const PaintSpec& spec, const StreetMap& map) {
  return PaintAlongStreet(spec, map, [&](const StreetPosition& position, int x, int y) {
    return ToGray(RoadsideTone(position, spec, x, y));
  });
}

Texture PaintField(const PaintSpec& spec) {
  GrayImage image(std::max(2, static_cast<int>(std::lround(spec.width_m / spec.texel_m))),
                  std::max(2, static_cast<int>(std::lround(spec.height_m / spec.texel_m))));
  const int first_x = static_cast<int>(std::lround(spec.origin.x() / spec.texel_m));
  const int first_y = static_cast<int>(std::lround(spec.origin.y() / spec.texel_m));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      image.row(y)[x] = ToGray(FieldTone(spec.tone, spec.seed, first_x + x, first_y + image.height - y));
    }
  }
  return MakeTexture(std::move(image), {});
}

// The crest is a sum of waves, with tree tops on it; woods and clearings below.
Texture PaintRidge(const PaintSpec& spec) {
  GrayImage image(std::max(2, static_cast<int>(std::lround(spec.width_m / spec.texel_m))),
                  std::max(2, static_cast<int>(std::lround(spec.height_m / spec.texel_m))));
  GrayImage cover(image.width, image.height);
  const int first_x = static_cast<int>(std::lround(spec.origin.x() / spec.texel_m));
  // The farther, the paler and the flatter: air lies between.
  const double contrast = std::clamp((190.0 - spec.tone) / 100.0, 0.1, 1.0);
  for (int x = 0; x < image.width; ++x) {
    const auto along = static_cast<float>(first_x + x);
    const double crest = 0.45 + 0.55 * static_cast<double>(FractalNoise(spec.seed, along / 160.0F, 0.5F, 3));
    const double top = 0.06 * static_cast<double>(PlaneNoise(HashOf(spec.seed, 3), along / 5.0F, 0.5F)) +
                       0.02 * static_cast<double>(UnitOf(HashOf(spec.seed, static_cast<uint32_t>(first_x + x))));
    for (int y = 0; y < image.height; ++y) {
      const double height = 1.0 - (y + 0.5) / image.height;
      cover.row(y)[x] = height < crest - top ? 255 : 0;
      const bool is_clearing = Stain(HashOf(spec.seed, 4), (first_x + x) / 3, 2 * y / 3) > 0.45;
      image.row(y)[x] =
          ToGray(spec.tone + contrast * ((is_clearing ? 34.0 : 0.0) + 14.0 * Speckle(spec.seed, first_x + x, y) +
                                         16.0 * Stain(HashOf(spec.seed, 5), first_x + x, y)));
    }
  }
  return MakeTexture(std::move(image), std::move(cover));
}

}  // namespace tessera
