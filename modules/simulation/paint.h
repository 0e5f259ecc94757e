// What surfaces look like. A surface's paint is a pure function of its specification, so it is made when first seen.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "simulation/texture.h"

namespace tessera {

class StreetMap;

enum class Material {
  kFacade,  // windows, doors, shop fronts; plaster or brick
  kGround,  // road, curb, pavement and grass, as the street map says for `origin`
  kCurb,
  kFoliage,  // leaves with holes between them
  kBark,
  kHedge,
  kFence,
  kCarSide,
  kCarEnd,
  kCarRoof,
  kSign,
  kSky,
  kSkyline,  // far buildings
  kWallpaper,
  kPoster,
  kBooks,
  kWood,
  kCarpet,
  kCeiling,
};

struct PaintSpec {
  Material material = Material::kFacade;
  uint32_t seed = 0;
  double width_m = 1.0;  // extent of the surface
  double height_m = 1.0;
  double texel_m = 0.02;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  // kGround: world x, z of the bottom left corner, m
};

// `map` may be null if the material is not kGround.
Texture Paint(const PaintSpec& spec, const StreetMap* map);

// The single materials.
Texture PaintFacade(const PaintSpec& spec);
Texture PaintSkyline(const PaintSpec& spec);
Texture PaintGround(const PaintSpec& spec, const StreetMap& map);
Texture PaintFoliage(const PaintSpec& spec);
Texture PaintFence(const PaintSpec& spec);
Texture PaintCarSide(const PaintSpec& spec);
Texture PaintCarEnd(const PaintSpec& spec);
Texture PaintSign(const PaintSpec& spec);
Texture PaintSky(const PaintSpec& spec);
Texture PaintWallpaper(const PaintSpec& spec);
Texture PaintPoster(const PaintSpec& spec);
Texture PaintBooks(const PaintSpec& spec);
Texture PaintWood(const PaintSpec& spec);
// Of one tone with this grain: bark, curbs, car roofs, carpets, ceilings, hedges.
Texture PaintPlain(const PaintSpec& spec, double tone, double fine, double coarse);

}  // namespace tessera
