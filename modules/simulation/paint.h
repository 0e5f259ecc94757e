// What surfaces look like. A surface's paint is a pure function of its specification, so it is made when first seen.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "simulation/texture.h"

namespace tessera {

class StreetMap;
struct StreetPosition;

enum class Material {
  kFacade,  // windows, doors, shop fronts; plaster or brick
  kGround,  // road, curb, pavement and grass, as the street map says for `origin`
  kCurb,
  kFoliage,  // leaves with holes between them
  kBark,
  kHedge,
  kFence,
  kNoiseBarrier,  // panels between steel posts
  kCarSide,
  kCarEnd,
  kCarRoof,
  kSign,
  kSky,
  kSkyline,      // far buildings
  kHighway,      // lanes, lines and verges, as the street map says for `origin`
  kCountryRoad,  // a road of little texture between fields, as the street map says for `origin`
  kField,        // a meadow or an acre of little texture
  kRidge,        // a wooded hill against the sky
  kWallpaper,
  kPoster,
  kBooks,
  kWood,
  kCarpet,
  kScreen,  // of a computer
  kKeys,    // of its keyboard
  kPaper,   // with lines of text and a drawing
  kPackage,
  kCloth,  // of a shirt, plain or checked, or of trousers
  kCeiling,
};

struct PaintSpec {
  Material material = Material::kFacade;
  uint32_t seed = 0;
  double width_m = 1.0;  // extent of the surface
  double height_m = 1.0;
  double texel_m = 0.02;
  // World x, z of the bottom left corner of ground, so that its grain goes on across tiles; along a ridge: x. m
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  double tone = 100.0;     // gray of kCountryRoad's fields, kField, kRidge
  double roughness = 1.0;  // kCountryRoad: how strong the texture of road and verge is
};

// `map` may be null if the material is not kGround, kCountryRoad or kHighway.
Texture Paint(const PaintSpec& spec, const StreetMap* map);

// The single materials.
Texture PaintFacade(const PaintSpec& spec);
Texture PaintSkyline(const PaintSpec& spec);
Texture PaintGround(const PaintSpec& spec, const StreetMap& map);
Texture PaintCountryRoad(const PaintSpec& spec, const StreetMap& map);
Texture PaintHighway(const PaintSpec& spec, const StreetMap& map);
Texture PaintNoiseBarrier(const PaintSpec& spec);
Texture PaintField(const PaintSpec& spec);
Texture PaintRidge(const PaintSpec& spec);
// Ground of which each texel's gray follows from its position in the street and its number x, y in the world.
Texture PaintAlongStreet(const PaintSpec& spec, const StreetMap& map,
                         const std::function<uint8_t(const StreetPosition&, int, int)>& gray_at);
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
Texture PaintScreen(const PaintSpec& spec);
Texture PaintKeys(const PaintSpec& spec);
Texture PaintPaper(const PaintSpec& spec);
Texture PaintPackage(const PaintSpec& spec);
Texture PaintCloth(const PaintSpec& spec);
// Of one tone with this grain: bark, curbs, car roofs, carpets, ceilings, hedges.
Texture PaintPlain(const PaintSpec& spec, double tone, double fine, double coarse);

}  // namespace tessera
