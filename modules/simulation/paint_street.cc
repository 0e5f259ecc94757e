// Paint of objects in a street, and of its ground.
#include <algorithm>
#include <cmath>

#include "simulation/canvas.h"
#include "simulation/paint.h"
#include "simulation/street_map.h"

namespace tessera {
namespace {

uint8_t ToGray(double value) { return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)); }

// Distance of a point to the nearest multiple of `period`, beside `phase`.
double ToNearestMultiple(double x, double period) { return std::abs(x - period * std::floor(x / period + 0.5)); }

double AsphaltTone(const StreetPosition& position, uint32_t seed, int x, int y) {
  // Wheels polish two tracks in each lane; repairs leave patches of another tone.
  const double in_lane = std::abs(std::abs(position.lateral_m) - 0.5 * kRoadHalfWidthM);
  const double track = std::abs(in_lane - 0.75) < 0.25 ? 9.0 : 0.0;
  const float patch = StainAt(HashOf(seed, 5), x / 6, y / 6);
  const double repair = patch > 0.55F ? -22.0 : (patch < -0.6F ? 15.0 : 0.0);
  const float crack = StainAt(HashOf(seed, 6), x, y);
  const double gap = std::abs(crack) < 0.012F ? -32.0 : 0.0;
  return 96.0 + track + repair + gap + 15.0 * static_cast<double>(SpeckleAt(seed, x, y)) +
         9.0 * static_cast<double>(StainAt(seed, x, y));
}

bool IsPaintedLine(const StreetPosition& position) {
  const bool is_dash = position.along_m - 6.0 * std::floor(position.along_m / 6.0) < 3.0;
  return (std::abs(position.lateral_m) < 0.07 && is_dash) ||
         std::abs(std::abs(position.lateral_m) - kRoadHalfWidthM) < 0.06;
}

double PavementTone(const StreetPosition& position, uint32_t seed, int x, int y) {
  const auto slab = HashOf(static_cast<uint32_t>(static_cast<int>(std::floor(position.along_m / 0.6))),
                           static_cast<uint32_t>(static_cast<int>(std::floor(position.lateral_m / 0.6))));
  const bool is_joint =
      ToNearestMultiple(position.along_m, 0.6) < 0.015 || ToNearestMultiple(position.lateral_m, 0.6) < 0.015;
  return (is_joint ? 92.0 : 138.0) + 16.0 * static_cast<double>(UnitOf(slab)) +
         12.0 * static_cast<double>(SpeckleAt(seed, x, y)) + 10.0 * static_cast<double>(StainAt(seed, x, y));
}

double GrassTone(uint32_t seed, int x, int y) {
  return 88.0 + 30.0 * static_cast<double>(SpeckleAt(seed, x, y)) +
         22.0 * static_cast<double>(StainAt(HashOf(seed, 2), x / 2, y / 2));
}

// Sides and ends of a car have one color.
double CarTone(uint32_t seed) {
  Random random(HashOf(seed, 13));
  return random.Chance(0.5) ? random.Uniform(25.0, 90.0) : random.Uniform(130.0, 225.0);
}

double GroundTone(const StreetPosition& position, uint32_t seed, int x, int y) {
  const double side = std::abs(position.lateral_m);
  if (side > kLotLineM) return GrassTone(seed, x, y);
  if (side > kCurbM) return PavementTone(position, seed, x, y);
  if (IsPaintedLine(position)) return 205.0 + 18.0 * static_cast<double>(SpeckleAt(seed, x, y));
  return AsphaltTone(position, seed, x, y);
}

}  // namespace

Texture PaintAlongStreet(const PaintSpec& spec, const StreetMap& map,
                         const std::function<uint8_t(const StreetPosition&, int, int)>& gray_at) {
  GrayImage image(std::max(2, static_cast<int>(std::lround(spec.width_m / spec.texel_m))),
                  std::max(2, static_cast<int>(std::lround(spec.height_m / spec.texel_m))));
  // The position in the street is looked up at every kStep-th texel and interpolated between.
  constexpr int kStep = 8;
  // Grain goes on across the borders of tiles.
  const int first_x = static_cast<int>(std::lround(spec.origin.x() / spec.texel_m));
  const int first_y = static_cast<int>(std::lround(spec.origin.y() / spec.texel_m));
  for (int y = 0; y < image.height; ++y) {
    const double z_m = spec.origin.y() + (image.height - 0.5 - y) * spec.texel_m;
    StreetPosition position;
    StreetPosition next = map.PositionOf({spec.origin.x() + 0.5 * spec.texel_m, z_m});
    for (int x = 0; x < image.width; ++x) {
      if (x % kStep == 0) {
        position = next;
        next = map.PositionOf({spec.origin.x() + (x + kStep + 0.5) * spec.texel_m, z_m});
      }
      StreetPosition here = position;
      if (std::abs(next.along_m - position.along_m) < 1.0 && std::abs(next.lateral_m - position.lateral_m) < 1.0) {
        const double part = static_cast<double>(x % kStep) / kStep;
        here.along_m += part * (next.along_m - position.along_m);
        here.lateral_m += part * (next.lateral_m - position.lateral_m);
      }
      image.row(y)[x] = gray_at(here, first_x + x, first_y + image.height - y);
    }
  }
  return MakeTexture(std::move(image), {});
}

Texture PaintGround(const PaintSpec& spec, const StreetMap& map) {
  return PaintAlongStreet(spec, map, [&](const StreetPosition& position, int x, int y) {
    return ToGray(GroundTone(position, spec.seed, x, y));
  });
}

Texture PaintFoliage(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 70.0, {48.0, 26.0});
  GrayImage& image = canvas.image();
  GrayImage cover(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      // A round crown that frays towards its border.
      const double u = 2.0 * (x + 0.5) / image.width - 1.0;
      const double v = 2.0 * (y + 0.5) / image.height - 1.0;
      const double edge = 1.0 - u * u - v * v;
      const double leaf = 0.45 * static_cast<double>(StainAt(HashOf(spec.seed, 8), 2 * x, 2 * y)) +
                          0.35 * static_cast<double>(SpeckleAt(HashOf(spec.seed, 9), x, y));
      cover.row(y)[x] = edge + leaf > 0.25 ? 255 : 0;
      // Light comes from above.
      image.row(y)[x] = ToGray(static_cast<double>(image.row(y)[x]) - 30.0 * v);
    }
  }
  return MakeTexture(std::move(image), std::move(cover));
}

Texture PaintFence(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 60.0, {8.0, 8.0});
  Random& random = canvas.random();
  const double tone = random.Uniform(90.0, 200.0);
  const double plank_m = random.Uniform(0.1, 0.25);
  for (double x = 0.0; x < spec.width_m; x += plank_m + 0.02) {
    const double plank_tone = tone + random.Uniform(-18.0, 18.0);
    canvas.Fill({x, 0.0, plank_m, spec.height_m * random.Uniform(0.93, 1.0)}, plank_tone, {6.0, 9.0});
  }
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintCarSide(const PaintSpec& spec) {
  const double tone = CarTone(spec.seed);
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, {2.0, 5.0});
  const double w = spec.width_m;
  const double h = spec.height_m;
  canvas.Fill({0.0, 0.0, w, 0.16 * h}, 35.0);
  for (const double x : {0.14 * w, 0.68 * w}) {  // wheels
    canvas.Fill({x, 0.0, 0.18 * w, 0.6 * h}, 22.0);
    canvas.Fill({x + 0.05 * w, 0.1 * h, 0.08 * w, 0.38 * h}, 150.0, {12.0, 6.0});
  }
  canvas.Fill({0.47 * w, 0.1 * h, 0.008 * w, 0.85 * h}, tone - 40.0);
  canvas.Fill({0.32 * w, 0.72 * h, 0.06 * w, 0.05 * h}, tone - 60.0);
  canvas.Fill({0.6 * w, 0.72 * h, 0.06 * w, 0.05 * h}, tone - 60.0);
  canvas.Fill({0.0, 0.55 * h, 0.05 * w, 0.2 * h}, 215.0);
  canvas.Fill({0.95 * w, 0.55 * h, 0.05 * w, 0.2 * h}, 60.0);
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintCarEnd(const PaintSpec& spec) {
  const double tone = CarTone(spec.seed);
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, {2.0, 5.0});
  const double w = spec.width_m;
  const double h = spec.height_m;
  canvas.Fill({0.0, 0.0, w, 0.25 * h}, 30.0);
  canvas.Fill({0.04 * w, 0.55 * h, 0.16 * w, 0.22 * h}, 90.0);
  canvas.Fill({0.8 * w, 0.55 * h, 0.16 * w, 0.22 * h}, 90.0);
  canvas.Fill({0.35 * w, 0.3 * h, 0.3 * w, 0.17 * h}, 230.0);
  canvas.Scribble({0.37 * w, 0.32 * h, 0.26 * w, 0.12 * h}, 0.1, 20.0);
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintSign(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 215.0, {3.0, 6.0});
  canvas.Frame({0.0, 0.0, spec.width_m, spec.height_m}, 0.05, 45.0);
  canvas.Scribble({0.08, 0.08, spec.width_m - 0.16, spec.height_m - 0.16}, 0.2, 30.0);
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintSky(const PaintSpec& spec) {
  GrayImage image(1024, 1024);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float cloud = FractalNoise(spec.seed, static_cast<float>(x) / 90.0F, static_cast<float>(y) / 90.0F, 4);
      image.row(y)[x] = ToGray(185.0 + 120.0 * std::max(0.0, static_cast<double>(cloud) - 0.42));
    }
  }
  return MakeTexture(std::move(image), {});
}

}  // namespace tessera
