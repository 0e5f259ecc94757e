// A wall to paint on, measured in meters from its bottom left corner: x to the right, y up.
#pragma once

#include <cstdint>

#include "core/image.h"
#include "simulation/random.h"

namespace tessera {

struct Area {
  double x_m = 0.0;
  double y_m = 0.0;
  double width_m = 0.0;
  double height_m = 0.0;
};

// How rough a surface looks: deviations from its tone, in gray values.
struct Grain {
  double fine = 4.0;     // of texels and their neighbors
  double coarse = 10.0;  // of stains of about a meter
};

class Canvas {
 public:
  // Gray of `tone` (0..255) all over.
  Canvas(double width_m, double height_m, double texel_m, uint32_t seed, double tone, const Grain& grain);

  // A rectangle of another material; what lies outside the canvas is cut off.
  void Fill(const Area& area, double tone, const Grain& grain = {3.0, 4.0});
  // A frame of bars along the inside of the area's border.
  void Frame(const Area& area, double bar_m, double tone);
  // Courses of bricks in running bond, each brick of its own tone, with mortar between.
  void Bricks(const Area& area, double brick_m, double course_m, double tone);
  // Letters or spray of no meaning: strokes in a grid of cells.
  void Scribble(const Area& area, double cell_m, double tone);

  double width_m() const { return width_m_; }
  double height_m() const { return height_m_; }
  Random& random() { return random_; }
  GrayImage& image() { return image_; }

 private:
  Rect ToTexels(const Area& area) const;

  double width_m_;
  double height_m_;
  double texel_m_;
  Random random_;
  uint32_t grain_seed_;
  GrayImage image_;
};

// A value in [-1, 1] that varies smoothly over some 20 texels, the same for the same texel and seed. Cheap.
float StainAt(uint32_t seed, int x, int y);
// A value in [-1, 1] of a single texel with a little of its neighbors in it. Cheap.
float SpeckleAt(uint32_t seed, int x, int y);

}  // namespace tessera
