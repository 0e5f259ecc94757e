#include "simulation/canvas.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tessera {
namespace {

// Noise is read from two fields made once: hashing each texel of each wall would take longer than drawing it.
constexpr int kFieldSize = 512;

struct NoiseFields {
  std::vector<float> stains;
  std::vector<float> speckles;
};

// Noise of `period` cells that repeats beyond them, so that the field has no seam.
float RepeatingNoise(uint32_t seed, float x, float y, int period) {
  const auto at = [&](int i, int j) {
    return UnitOf(HashOf(seed, static_cast<uint32_t>(i % period), static_cast<uint32_t>(j % period)));
  };
  const int i = static_cast<int>(x);
  const int j = static_cast<int>(y);
  const float u = x - static_cast<float>(i);
  const float v = y - static_cast<float>(j);
  const float across = u * u * (3.0F - 2.0F * u);
  const float along = v * v * (3.0F - 2.0F * v);
  const float top = at(i, j) + across * (at(i + 1, j) - at(i, j));
  const float bottom = at(i, j + 1) + across * (at(i + 1, j + 1) - at(i, j + 1));
  return top + along * (bottom - top);
}

NoiseFields MakeFields() {
  NoiseFields fields;
  fields.stains.resize(kFieldSize * kFieldSize);
  fields.speckles.resize(kFieldSize * kFieldSize);
  for (int y = 0; y < kFieldSize; ++y) {
    for (int x = 0; x < kFieldSize; ++x) {
      const auto noise = [&](uint32_t seed, int period) {
        const float scale = static_cast<float>(period) / kFieldSize;
        return RepeatingNoise(seed, static_cast<float>(x) * scale, static_cast<float>(y) * scale, period);
      };
      const size_t index = static_cast<size_t>(y) * kFieldSize + static_cast<size_t>(x);
      fields.stains[index] = 1.1F * noise(1, 8) + 0.6F * noise(2, 24) + 0.3F * noise(3, 64) - 1.0F;
      const float own = UnitOf(HashOf(4, static_cast<uint32_t>(x), static_cast<uint32_t>(y)));
      fields.speckles[index] = 0.8F * own + 1.2F * noise(5, 170) - 1.0F;
    }
  }
  return fields;
}

const NoiseFields& Fields() {
  static const NoiseFields fields = MakeFields();
  return fields;
}

size_t FieldIndex(uint32_t seed, int x, int y) {
  constexpr uint32_t kMask = kFieldSize - 1;
  const uint32_t i = (static_cast<uint32_t>(x) + seed) & kMask;
  const uint32_t j = (static_cast<uint32_t>(y) + (seed >> 9)) & kMask;
  return static_cast<size_t>(j) * kFieldSize + i;
}

uint8_t ToGray(float value) { return static_cast<uint8_t>(std::clamp(value, 0.0F, 255.0F)); }

int TexelsIn(double length_m, double texel_m) { return std::max(2, static_cast<int>(std::lround(length_m / texel_m))); }

}  // namespace

float StainAt(uint32_t seed, int x, int y) { return Fields().stains[FieldIndex(seed, x, y)]; }
float SpeckleAt(uint32_t seed, int x, int y) { return Fields().speckles[FieldIndex(seed, x, y)]; }

Canvas::Canvas(double width_m, double height_m, double texel_m, uint32_t seed, double tone, const Grain& grain)
    : width_m_(width_m),
      height_m_(height_m),
      texel_m_(texel_m),
      random_(seed),
      grain_seed_(HashOf(seed, 77)),
      image_(TexelsIn(width_m, texel_m), TexelsIn(height_m, texel_m)) {
  Fill({0.0, 0.0, width_m, height_m}, tone, grain);
}

Rect Canvas::ToTexels(const Area& area) const {
  const auto x_at = [&](double x_m) {
    return std::clamp(static_cast<int>(std::lround(x_m / texel_m_)), 0, image_.width);
  };
  const auto y_at = [&](double y_m) {
    return std::clamp(image_.height - static_cast<int>(std::lround(y_m / texel_m_)), 0, image_.height);
  };
  const int left = x_at(area.x_m);
  const int top = y_at(area.y_m + area.height_m);
  return {left, top, x_at(area.x_m + area.width_m) - left, y_at(area.y_m) - top};
}

void Canvas::Fill(const Area& area, double tone, const Grain& grain) {
  const Rect rect = ToTexels(area);
  const auto base = static_cast<float>(tone);
  const auto fine = static_cast<float>(grain.fine);
  const auto coarse = static_cast<float>(grain.coarse);
  const uint32_t seed = HashOf(grain_seed_, random_.Next());
  for (int y = rect.y; y < rect.bottom(); ++y) {
    for (int x = rect.x; x < rect.right(); ++x) {
      image_.row(y)[x] = ToGray(base + fine * SpeckleAt(seed, x, y) + coarse * StainAt(seed, x, y));
    }
  }
}

void Canvas::Frame(const Area& area, double bar_m, double tone) {
  Fill({area.x_m, area.y_m, area.width_m, bar_m}, tone);
  Fill({area.x_m, area.y_m + area.height_m - bar_m, area.width_m, bar_m}, tone);
  Fill({area.x_m, area.y_m, bar_m, area.height_m}, tone);
  Fill({area.x_m + area.width_m - bar_m, area.y_m, bar_m, area.height_m}, tone);
}

void Canvas::Bricks(const Area& area, double brick_m, double course_m, double tone) {
  const double joint_m = 0.02;
  int course = 0;
  for (double y = area.y_m; y < area.y_m + area.height_m; y += course_m, ++course) {
    const double shift = course % 2 == 0 ? 0.0 : 0.5 * brick_m;
    for (double x = area.x_m - shift; x < area.x_m + area.width_m; x += brick_m) {
      const double left = std::max(x, area.x_m);
      const double right = std::min(x + brick_m - joint_m, area.x_m + area.width_m);
      const double top = std::min(y + course_m - joint_m, area.y_m + area.height_m);
      if (right > left && top > y) {
        Fill({left, y, right - left, top - y}, tone + random_.Uniform(-22.0, 22.0), {5.0, 6.0});
      }
    }
  }
}

void Canvas::Scribble(const Area& area, double cell_m, double tone) {
  for (double y = area.y_m; y + cell_m <= area.y_m + area.height_m; y += 1.3 * cell_m) {
    for (double x = area.x_m; x + cell_m <= area.x_m + area.width_m; x += cell_m) {
      const uint32_t strokes = random_.Next();
      const double pen = 0.2 * cell_m;
      if ((strokes & 1) != 0) Fill({x, y, pen, cell_m}, tone);
      if ((strokes & 2) != 0) Fill({x + 0.55 * cell_m, y, pen, cell_m}, tone);
      if ((strokes & 4) != 0) Fill({x, y, 0.75 * cell_m, pen}, tone);
      if ((strokes & 8) != 0) Fill({x, y + 0.4 * cell_m, 0.75 * cell_m, pen}, tone);
      if ((strokes & 16) != 0) Fill({x, y + 0.8 * cell_m, 0.75 * cell_m, pen}, tone);
    }
  }
}

}  // namespace tessera
