// What is far: wooded ridges all around, and clouds.
#include "simulation/random.h"
#include "simulation/world.h"

namespace tessera {
namespace {

// A ring of walls around the middle; seen from inside.
void AddRidge(const Eigen::Vector2d& middle, double radius_m, double height_m, double texel_m, double tone,
              uint32_t seed, WorldBuilder& builder) {
  constexpr size_t kPerQuarter = 10;
  constexpr double kDeepM = 60.0;
  double along = 0.0;
  for (size_t i = 0; i < 4 * kPerQuarter; ++i) {
    const auto at = [&](size_t k) -> Eigen::Vector2d {
      k %= 4 * kPerQuarter;
      const double part = static_cast<double>(k % kPerQuarter) / kPerQuarter;
      return middle + radius_m * OnCircle(k / kPerQuarter, part);
    };
    const Eigen::Vector2d from = at(i + 1), to = at(i);
    const double width = (to - from).norm();
    const PaintSpec spec{Material::kRidge, seed, width, height_m + kDeepM, texel_m, {-along - width, 0.0}, tone};
    Surface wall = builder.Wall(from, to, -kDeepM, height_m + kDeepM, builder.AddPaint(spec));
    wall.brightness = 1.0F;
    wall.two_sided = true;
    builder.world().far.push_back(wall);
    along += width;
  }
}

}  // namespace

void AddRidges(const Eigen::Vector2d& middle, double radius_m, Random& random, WorldBuilder& builder) {
  AddRidge(middle, radius_m, 95.0, 1.0, 78.0, random.Next(), builder);
  AddRidge(middle, radius_m + 900.0, 190.0, 2.0, 125.0, random.Next(), builder);
  AddRidge(middle, radius_m + 2600.0, 420.0, 4.0, 160.0, random.Next(), builder);
}

void AddClouds(const Eigen::Vector2d& middle, uint32_t seed, WorldBuilder& builder) {
  constexpr double kSkyM = 14000.0;
  const int32_t clouds = builder.AddPaint({Material::kSky, seed, 2.0 * kSkyM, 2.0 * kSkyM, 8.0});
  builder.world().far.push_back({{middle.x() - kSkyM, -1400.0, middle.y() + kSkyM},
                                 {2.0 * kSkyM, 0.0, 0.0},
                                 {0.0, 0.0, -2.0 * kSkyM},
                                 clouds,
                                 1.0F});
}

}  // namespace tessera
