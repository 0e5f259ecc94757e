#include "simulation/paint.h"

#include <stdexcept>

#include "simulation/canvas.h"

namespace tessera {
namespace {

const StreetMap& Needed(const StreetMap* map) {
  if (map == nullptr) throw std::invalid_argument("ground needs a street map");
  return *map;
}

}  // namespace

Texture PaintPlain(const PaintSpec& spec, double tone, double fine, double coarse) {
  Canvas canvas(spec.width_m, spec.height_m, spec.texel_m, spec.seed, tone, {fine, coarse});
  return MakeTexture(std::move(canvas.image()), {});
}

Texture Paint(const PaintSpec& spec, const StreetMap* map) {
  const double tone = static_cast<double>(UnitOf(HashOf(spec.seed, 3)));
  switch (spec.material) {
    case Material::kFacade:
      return PaintFacade(spec);
    case Material::kGround:
      return PaintGround(spec, Needed(map));
    case Material::kCountryRoad:
      return PaintCountryRoad(spec, Needed(map));
    case Material::kHighway:
      return PaintHighway(spec, Needed(map));
    case Material::kNoiseBarrier:
      return PaintNoiseBarrier(spec);
    case Material::kCurb:
      return PaintPlain(spec, 150.0, 14.0, 14.0);
    case Material::kFoliage:
      return PaintFoliage(spec);
    case Material::kBark:
      return PaintPlain(spec, 60.0, 26.0, 18.0);
    case Material::kHedge:
      return PaintPlain(spec, 55.0 + 30.0 * tone, 42.0, 16.0);
    case Material::kFence:
      return PaintFence(spec);
    case Material::kCarSide:
      return PaintCarSide(spec);
    case Material::kCarEnd:
      return PaintCarEnd(spec);
    case Material::kCarRoof:
      return PaintPlain(spec, 40.0 + 180.0 * tone, 2.0, 6.0);
    case Material::kSign:
      return PaintSign(spec);
    case Material::kSky:
      return PaintSky(spec);
    case Material::kSkyline:
      return PaintSkyline(spec);
    case Material::kField:
      return PaintField(spec);
    case Material::kRidge:
      return PaintRidge(spec);
    case Material::kWallpaper:
      return PaintWallpaper(spec);
    case Material::kPoster:
      return PaintPoster(spec);
    case Material::kBooks:
      return PaintBooks(spec);
    case Material::kWood:
      return PaintWood(spec);
    case Material::kCarpet:
      return PaintPlain(spec, 70.0 + 60.0 * tone, 30.0, 20.0);
    case Material::kScreen:
      return PaintScreen(spec);
    case Material::kKeys:
      return PaintKeys(spec);
    case Material::kPaper:
      return PaintPaper(spec);
    case Material::kPackage:
      return PaintPackage(spec);
    case Material::kCloth:
      return PaintCloth(spec);
    case Material::kCeiling:
      return PaintPlain(spec, 205.0, 3.0, 8.0);
  }
  throw std::invalid_argument("unknown material");
}

}  // namespace tessera
