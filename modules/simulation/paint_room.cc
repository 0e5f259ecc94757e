// What a room is furnished with.
#include <algorithm>

#include "simulation/canvas.h"
#include "simulation/paint.h"

namespace tessera {

Texture PaintWallpaper(const PaintSpec& spec) {
  Random random(HashOf(spec.seed, 21));
  const double tone = random.Uniform(140.0, 195.0);
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, {5.0, 14.0});
  canvas.Fill({0.0, 0.0, spec.width_m, 0.1}, tone - 70.0);          // skirting board
  for (int i = 0; i < static_cast<int>(2.0 * spec.width_m); ++i) {  // switches, sockets, hooks, notes
    const double size = random.Uniform(0.05, 0.2);
    const double thing_tone = random.Uniform(30.0, 240.0);
    canvas.Fill({random.Uniform(0.0, spec.width_m - size), random.Uniform(0.2, spec.height_m - 0.3), size,
                 random.Uniform(0.05, 0.25)},
                thing_tone, {4.0, 4.0});
  }
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintPoster(const PaintSpec& spec) {
  Random random(HashOf(spec.seed, 22));
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, random.Uniform(40.0, 210.0), {8.0, 30.0});
  for (int i = 0; i < 14; ++i) {
    const double width = random.Uniform(0.1, 0.5) * spec.width_m;
    const double height = random.Uniform(0.05, 0.4) * spec.height_m;
    const double tone = random.Uniform(20.0, 240.0);
    canvas.Fill({random.Uniform(0.0, spec.width_m - width), random.Uniform(0.0, spec.height_m - height), width, height},
                tone, {8.0, 20.0});
  }
  canvas.Scribble({0.1 * spec.width_m, 0.08 * spec.height_m, 0.8 * spec.width_m, 0.2 * spec.height_m},
                  0.06 * spec.width_m, 20.0);
  canvas.Frame({0.0, 0.0, spec.width_m, spec.height_m}, 0.03, random.Uniform(15.0, 90.0));
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintBooks(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 40.0, {5.0, 8.0});
  Random& random = canvas.random();
  const double shelf_m = 0.36;
  for (double y = 0.04; y + shelf_m <= spec.height_m + 0.04; y += shelf_m) {
    canvas.Fill({0.0, y - 0.04, spec.width_m, 0.04}, 150.0, {8.0, 10.0});
    for (double x = 0.02; x < spec.width_m - 0.06;) {
      const double thickness = random.Uniform(0.015, 0.06);
      const double height = random.Uniform(0.18, 0.31);
      const double tone = random.Uniform(30.0, 225.0);
      canvas.Fill({x, y, thickness, height}, tone, {4.0, 6.0});
      canvas.Fill({x, y + random.Uniform(0.4, 0.8) * height, thickness, 0.02}, tone > 120.0 ? 30.0 : 220.0);
      x += thickness + (random.Chance(0.06) ? random.Uniform(0.05, 0.25) : 0.004);
    }
  }
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintWood(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 50.0, {4.0, 4.0});
  Random& random = canvas.random();
  const double tone = random.Uniform(80.0, 165.0);
  const double plank_m = random.Uniform(0.1, 0.2);
  for (double y = 0.0; y < spec.height_m; y += plank_m) {
    for (double x = -random.Uniform(0.0, 1.5); x < spec.width_m;) {
      const double length = random.Uniform(0.8, 1.8);
      canvas.Fill({x, y, length - 0.006, plank_m - 0.006}, tone + random.Uniform(-25.0, 25.0), {9.0, 14.0});
      x += length;
    }
  }
  return MakeTexture(std::move(canvas.image()), {});
}

// A black frame, a dark background, and windows with lines of text.
Texture PaintScreen(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 14.0, {1.0, 1.0});
  Random& random = canvas.random();
  const double w = spec.width_m, h = spec.height_m;
  if (w < 0.1) return MakeTexture(std::move(canvas.image()), {});  // seen from the side
  canvas.Fill({0.02, 0.02, w - 0.04, h - 0.04}, 45.0, {1.0, 3.0});
  for (int i = 0; i < 3; ++i) {
    const double width = random.Uniform(0.3, 0.5) * w;
    const double height = random.Uniform(0.4, 0.6) * h;
    const double x = random.Uniform(0.03, w - width - 0.03);
    const double y = random.Uniform(0.03, h - height - 0.03);
    const double tone = random.Chance(0.5) ? 205.0 : 70.0;
    canvas.Fill({x, y, width, height}, tone, {1.0, 1.0});
    canvas.Fill({x, y + height - 0.012, width, 0.012}, 120.0, {1.0, 1.0});
    canvas.Scribble({x + 0.01, y + 0.01, width - 0.02, height - 0.03}, 0.012, tone > 100.0 ? 60.0 : 180.0);
  }
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintKeys(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 35.0, {2.0, 2.0});
  constexpr double kKeyM = 0.019;
  for (double y = 0.006; y + kKeyM < spec.height_m; y += kKeyM) {
    for (double x = 0.006; x + kKeyM < spec.width_m; x += kKeyM) {
      canvas.Fill({x, y, kKeyM - 0.004, kKeyM - 0.004}, canvas.random().Uniform(60.0, 85.0), {2.0, 2.0});
      canvas.Fill({x + 0.004, y + 0.006, 0.005, 0.005}, 190.0, {2.0, 2.0});
    }
  }
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintPaper(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 215.0, {1.5, 3.0});
  Random& random = canvas.random();
  const double w = spec.width_m, h = spec.height_m;
  for (double y = h - 0.03; y > 0.3 * h; y -= random.Chance(0.2) ? 0.02 : 0.009) {
    canvas.Scribble({0.015, y, random.Uniform(0.4, 1.0) * (w - 0.03), 0.006}, 0.005, 70.0);
  }
  const double tone = random.Uniform(60.0, 180.0);
  canvas.Fill({0.1 * w, 0.05 * h, random.Uniform(0.3, 0.8) * w, 0.2 * h}, tone, {6.0, 25.0});
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintPackage(const PaintSpec& spec) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, 120.0, {2.0, 5.0});
  Random& random = canvas.random();
  const double w = spec.width_m, h = spec.height_m;
  const double tone = random.Uniform(60.0, 200.0);
  canvas.Fill({0.0, 0.0, w, h}, tone, {2.0, 6.0});
  for (int i = 0; i < 3; ++i) {
    const double x = random.Uniform(0.0, 0.6) * w;
    const double y = random.Uniform(0.0, 0.7) * h;
    const double width = random.Uniform(0.2, 0.4) * w;
    const double label_tone = random.Uniform(45.0, 220.0);
    canvas.Fill({x, y, width, random.Uniform(0.1, 0.3) * h}, label_tone, {3.0, 8.0});
  }
  canvas.Scribble({0.15 * w, random.Uniform(0.3, 0.6) * h, 0.7 * w, 0.25 * h}, 0.012, tone > 130.0 ? 45.0 : 210.0);
  return MakeTexture(std::move(canvas.image()), {});
}

// Folds, which bend the checks of every second one; on others a print.
Texture PaintCloth(const PaintSpec& spec) {
  Random random(HashOf(spec.seed, 29));
  const double tone = random.Uniform(40.0, 200.0);
  const Grain folds{4.0, 26.0};
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, folds);
  const double w = spec.width_m, h = spec.height_m;
  if (random.Chance(0.5)) {
    const double check_m = random.Uniform(0.03, 0.06), stripe_m = random.Uniform(0.25, 0.45) * check_m;
    const double other = tone > 120.0 ? tone - 70.0 : tone + 70.0;
    const auto next_m = [&] { return random.Uniform(0.7, 1.4) * check_m; };
    for (double x = 0.3 * check_m; x < w; x += next_m()) canvas.Fill({x, 0.0, stripe_m, h}, other, folds);
    for (double y = 0.3 * check_m; y < h; y += next_m()) canvas.Fill({0.0, y, w, stripe_m}, other, folds);
  } else {
    canvas.Scribble({0.2 * w, 0.5 * h, 0.6 * w, 0.3 * h}, 0.04, tone > 120.0 ? 30.0 : 220.0);
  }
  for (double y = 0.08; y < h; y += random.Uniform(0.07, 0.12)) canvas.Fill({0.5 * w, y, 0.012, 0.012}, 230.0);
  return MakeTexture(std::move(canvas.image()), {});
}

}  // namespace tessera
