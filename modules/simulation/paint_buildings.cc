// Facades: a wall, floors of windows, something at street level, and the traces of time.
#include <algorithm>

#include "simulation/canvas.h"
#include "simulation/paint.h"

namespace tessera {
namespace {

struct FacadeStyle {
  double wall_tone, frame_tone, floor_m, pitch_m, window_width_m, window_height_m;
  bool is_brick, has_shutters, has_shops;
};

FacadeStyle DrawStyle(Random& random) {
  FacadeStyle style;
  style.wall_tone = random.Uniform(70.0, 190.0);
  style.frame_tone = random.Chance(0.6) ? random.Uniform(190.0, 235.0) : random.Uniform(30.0, 60.0);
  style.floor_m = random.Uniform(2.8, 3.5);
  style.pitch_m = random.Uniform(2.1, 3.6);
  style.window_width_m = style.pitch_m * random.Uniform(0.35, 0.55);
  style.window_height_m = style.floor_m * random.Uniform(0.45, 0.6);
  style.is_brick = random.Chance(0.35);
  style.has_shutters = random.Chance(0.3);
  style.has_shops = random.Chance(0.3);
  return style;
}

void PaintWindow(const Area& area, const FacadeStyle& style, Canvas& canvas) {
  Random& random = canvas.random();
  // Glass mirrors the sky or shows a curtain or a dark room.
  canvas.Fill(area, random.Chance(0.3) ? random.Uniform(140.0, 200.0) : random.Uniform(25.0, 70.0), {3.0, 22.0});
  if (random.Chance(0.4)) {
    canvas.Fill({area.x_m, area.y_m + 0.4 * area.height_m, 0.35 * area.width_m, 0.6 * area.height_m},
                random.Uniform(120.0, 220.0), {8.0, 4.0});
  }
  canvas.Frame(area, 0.07, style.frame_tone);
  canvas.Fill({area.x_m + 0.5 * area.width_m - 0.03, area.y_m, 0.06, area.height_m}, style.frame_tone);
  canvas.Fill({area.x_m - 0.1, area.y_m - 0.12, area.width_m + 0.2, 0.12}, style.frame_tone - 40.0);  // sill
  if (style.has_shutters) {
    const double tone = style.wall_tone - 55.0;
    canvas.Fill({area.x_m - 0.45, area.y_m, 0.4, area.height_m}, tone, {10.0, 4.0});
    canvas.Fill({area.x_m + area.width_m + 0.05, area.y_m, 0.4, area.height_m}, tone, {10.0, 4.0});
  }
}

void PaintFloor(double bottom_m, const FacadeStyle& style, Canvas& canvas) {
  const double margin = 0.5 * (style.pitch_m - style.window_width_m);
  for (double x = margin; x + style.window_width_m < canvas.width_m() - 0.3; x += style.pitch_m) {
    if (canvas.random().Chance(0.92)) {
      PaintWindow({x, bottom_m + 0.3 * style.floor_m, style.window_width_m, style.window_height_m}, style, canvas);
    }
  }
}

void PaintStreetLevel(const FacadeStyle& style, Canvas& canvas) {
  Random& random = canvas.random();
  const double width = canvas.width_m();
  const double plinth_tone = style.wall_tone - random.Uniform(20.0, 50.0);
  canvas.Fill({0.0, 0.0, width, random.Uniform(0.4, 1.0)}, plinth_tone, {8.0, 10.0});
  for (double x = random.Uniform(0.3, 1.5); x + 1.2 < width;) {
    if (style.has_shops && random.Chance(0.6)) {
      const double span = std::min(random.Uniform(2.5, 5.0), width - x - 0.2);
      PaintWindow({x, 0.6, span, 1.9}, style, canvas);
      canvas.Fill({x, 2.55, span, 0.6}, random.Uniform(30.0, 220.0));
      canvas.Scribble({x + 0.2, 2.65, span - 0.4, 0.42}, 0.4, random.Chance(0.5) ? 235.0 : 25.0);
      x += span + random.Uniform(0.3, 1.0);
    } else if (random.Chance(0.35)) {
      canvas.Fill({x, 0.0, 1.1, 2.2}, random.Uniform(30.0, 150.0), {5.0, 8.0});
      canvas.Frame({x, 0.0, 1.1, 2.25}, 0.09, style.frame_tone);
      x += random.Uniform(1.6, 4.0);
    } else {
      PaintWindow({x, 0.9, style.window_width_m, style.window_height_m}, style, canvas);
      x += style.pitch_m;
    }
  }
}

// Pipes, boxes, posters, repairs, sprayed letters.
void PaintTraces(const FacadeStyle& style, Canvas& canvas) {
  Random& random = canvas.random();
  const int num_traces = static_cast<int>(canvas.width_m() / 2.5);
  for (int i = 0; i < num_traces; ++i) {
    const double x = random.Uniform(0.0, canvas.width_m() - 0.5);
    const double y = random.Uniform(0.2, 2.6);
    switch (random.Index(4)) {
      case 0:
        canvas.Fill({x, 0.0, 0.12, canvas.height_m()}, style.wall_tone - 45.0);
        break;
      case 1: {
        const double tone = random.Uniform(40.0, 230.0);
        canvas.Fill({x, y, random.Uniform(0.3, 0.8), random.Uniform(0.3, 0.9)}, tone);
        break;
      }
      case 2: {
        const double tone = style.wall_tone + random.Uniform(-35.0, 35.0);
        canvas.Fill({x, y, random.Uniform(0.6, 2.0), random.Uniform(0.4, 1.5)}, tone, {5.0, 6.0});
        break;
      }
      default:
        canvas.Scribble({x, y, 1.6, 0.5}, 0.42, random.Uniform(20.0, 240.0));
        break;
    }
  }
}

}  // namespace

Texture PaintFacade(const PaintSpec& spec) {
  Random random(HashOf(spec.seed, 11));
  const FacadeStyle style = DrawStyle(random);
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, style.wall_tone, {6.0, 12.0});
  if (style.is_brick) {
    canvas.Fill({0.0, 0.0, spec.width_m, spec.height_m}, style.wall_tone + 25.0);  // mortar
    canvas.Bricks({0.0, 0.0, spec.width_m, spec.height_m}, 0.3, 0.12, style.wall_tone);
  }
  for (double bottom = style.floor_m; bottom + style.floor_m < spec.height_m; bottom += style.floor_m) {
    PaintFloor(bottom, style, canvas);
    if (!style.is_brick) canvas.Fill({0.0, bottom - 0.08, spec.width_m, 0.16}, style.wall_tone + 25.0);
  }
  PaintStreetLevel(style, canvas);
  PaintTraces(style, canvas);
  canvas.Fill({0.0, spec.height_m - 0.5, spec.width_m, 0.5}, style.wall_tone + 40.0, {4.0, 8.0});  // cornice
  canvas.Fill({0.0, spec.height_m - 0.55, spec.width_m, 0.08}, style.wall_tone - 50.0);
  return MakeTexture(std::move(canvas.image()), {});
}

Texture PaintSkyline(const PaintSpec& spec) {
  Random random(HashOf(spec.seed, 12));
  // Air between makes far things pale.
  const double tone = random.Uniform(140.0, 185.0);
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, {3.0, 8.0});
  const double floor_m = random.Uniform(3.0, 4.5);
  const double pitch_m = random.Uniform(2.5, 6.0);
  for (double y = 1.0; y + floor_m < spec.height_m; y += floor_m) {
    for (double x = 0.8; x + pitch_m < spec.width_m; x += pitch_m) {
      canvas.Fill({x, y, 0.6 * pitch_m, 0.6 * floor_m}, tone - random.Uniform(15.0, 45.0));
    }
  }
  return MakeTexture(std::move(canvas.image()), {});
}

}  // namespace tessera
