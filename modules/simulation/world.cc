#include "simulation/world.h"

#include <array>
#include <cmath>

#include "simulation/random.h"

namespace tessera {
namespace {

Eigen::Vector3d OnGround(const Eigen::Vector2d& p, double height_m) { return {p.x(), -height_m, p.y()}; }

}  // namespace

float BrightnessOf(const Eigen::Vector3d& normal) {
  const Eigen::Vector3d to_sun = Eigen::Vector3d(0.5, -0.7, -0.35).normalized();
  return static_cast<float>(0.68 + 0.34 * std::max(0.0, normal.dot(to_sun)));
}

int32_t WorldBuilder::AddPaint(const PaintSpec& spec) {
  world_.paints.push_back(spec);
  return static_cast<int32_t>(world_.paints.size()) - 1;
}

Surface WorldBuilder::Wall(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double bottom_m, double height_m,
                           int32_t paint) const {
  const Eigen::Vector2d along = to - from;
  // Who sees `from` on the left stands to the right of the way from `from` to `to`.
  const Eigen::Vector2d normal = RightOf(along.normalized());
  return {OnGround(from, bottom_m),
          {along.x(), 0.0, along.y()},
          {0.0, -height_m, 0.0},
          paint,
          BrightnessOf({normal.x(), 0.0, normal.y()})};
}

std::vector<Surface> WorldBuilder::Box(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead,
                                       double half_length_m, double half_width_m, double bottom_m, double height_m,
                                       int32_t sides, int32_t ends) const {
  const Eigen::Vector2d length = half_length_m * ahead;
  const Eigen::Vector2d width = half_width_m * RightOf(ahead);
  const Eigen::Vector2d front_right = middle + length + width;
  const Eigen::Vector2d front_left = middle + length - width;
  const Eigen::Vector2d back_right = middle - length + width;
  const Eigen::Vector2d back_left = middle - length - width;
  return {
      Wall(back_right, front_right, bottom_m, height_m, sides), Wall(front_right, front_left, bottom_m, height_m, ends),
      Wall(front_left, back_left, bottom_m, height_m, sides), Wall(back_left, back_right, bottom_m, height_m, ends)};
}

Surface WorldBuilder::Lid(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, double half_length_m,
                          double half_width_m, double height_m, int32_t paint) const {
  const Eigen::Vector2d right = RightOf(ahead);
  const Eigen::Vector2d corner = middle - half_length_m * ahead - half_width_m * right;
  return {OnGround(corner, height_m), 2.0 * half_width_m * Eigen::Vector3d(right.x(), 0.0, right.y()),
          2.0 * half_length_m * Eigen::Vector3d(ahead.x(), 0.0, ahead.y()), paint, BrightnessOf({0.0, -1.0, 0.0})};
}

void WorldBuilder::Add(const std::vector<Surface>& surfaces) {
  world_.surfaces.insert(world_.surfaces.end(), surfaces.begin(), surfaces.end());
}

TreeKind MakeTreeKind(double crown_m, double trunk_m, double thick_m, Random& random, WorldBuilder& builder) {
  const auto paint = [&](Material material, double width, double height, double texel) {
    return builder.AddPaint({material, random.Next(), width, height, texel});
  };
  TreeKind kind{crown_m, trunk_m, thick_m, paint(Material::kBark, 2.0 * thick_m, trunk_m + 0.5 * crown_m, 0.02), {}};
  for (int32_t& leaves : kind.leaves) leaves = paint(Material::kFoliage, crown_m, crown_m, 0.04);
  return kind;
}

void PlantTree(const TreeKind& kind, const Eigen::Vector2d& foot, double ground_m, WorldBuilder& builder) {
  const double height = kind.trunk_m + 0.5 * kind.crown_m;
  builder.Add(builder.Box(foot, {1.0, 0.0}, kind.thick_m, kind.thick_m, ground_m, height, kind.bark, kind.bark));
  const Eigen::Vector2d across[] = {{1.0, 0.0}, {-0.5, 0.866}, {-0.5, -0.866}};
  for (size_t i = 0; i < kind.leaves.size(); ++i) {
    const Eigen::Vector2d half = 0.5 * kind.crown_m * across[i];
    Surface surface = builder.Wall(foot - half, foot + half, ground_m + kind.trunk_m, kind.crown_m, kind.leaves[i]);
    surface.two_sided = true;
    builder.Add(surface);
  }
}

std::vector<Surface> BuildCar(const Eigen::Vector2d& middle, const Eigen::Vector2d& ahead, uint32_t seed,
                              WorldBuilder& builder) {
  Random random(seed);
  const double length = random.Uniform(3.7, 4.8);
  const double width = random.Uniform(1.65, 1.85);
  const double height = random.Uniform(0.85, 1.0);
  const double cabin_height = random.Uniform(0.5, 0.75);
  const auto paint = [&](Material material, double width_m, double height_m) {
    return builder.AddPaint({material, seed, width_m, height_m, 0.02});
  };
  const int32_t roof = paint(Material::kCarRoof, width, length);
  const int32_t glass = builder.AddPaint({Material::kCarEnd, seed + 1, 2.0, cabin_height, 0.02});
  std::vector<Surface> car =
      builder.Box(middle, ahead, 0.5 * length, 0.5 * width, 0.0, height, paint(Material::kCarSide, length, height),
                  paint(Material::kCarEnd, width, height));
  car.push_back(builder.Lid(middle, ahead, 0.5 * length, 0.5 * width, height, roof));
  const Eigen::Vector2d cabin = middle - 0.08 * length * ahead;
  const std::vector<Surface> walls =
      builder.Box(cabin, ahead, 0.27 * length, 0.44 * width, height, cabin_height, glass, glass);
  car.insert(car.end(), walls.begin(), walls.end());
  car.push_back(builder.Lid(cabin, ahead, 0.27 * length, 0.44 * width, height + cabin_height, roof));
  return car;
}

std::vector<Surface> BuildLorry(double length_m, Random& random, WorldBuilder& builder) {
  constexpr double kHalfWidthM = 1.25;
  const double height_m = random.Uniform(2.8, 3.6);
  // Windows, a plain side, or advertisements.
  constexpr std::array kSides{Material::kFacade, Material::kCarSide, Material::kSign};
  const Material side = kSides[static_cast<size_t>(random.Index(kSides.size()))];
  const uint32_t seed = random.Next();
  const int32_t sides = builder.AddPaint({side, seed, length_m, height_m, 0.02});
  const int32_t ends = builder.AddPaint({Material::kSign, seed + 1, 2.0 * kHalfWidthM, height_m, 0.02});
  return builder.Box({0.0, 0.0}, {0.0, 1.0}, 0.5 * length_m, kHalfWidthM, 0.25, height_m, sides, ends);
}

}  // namespace tessera
