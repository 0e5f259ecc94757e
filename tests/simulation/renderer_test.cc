// A hand-made world: what hides what, and how far it is.
#include "simulation/renderer.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

CameraCalibration Camera() {
  return {.width_px = 80, .height_px = 60, .fx_px = 50.0, .fy_px = 50.0, .cx_px = 40.0, .cy_px = 30.0};
}

// A wall of 20 m x 20 m across the view at this depth, seen from the origin.
Surface WallAt(double z_m, int32_t paint) {
  return {.corner = {-10.0, 10.0, z_m}, .across = {20.0, 0.0, 0.0}, .up = {0.0, -20.0, 0.0}, .paint = paint};
}

World Walls(const std::vector<Surface>& surfaces) {
  World world;
  for (const Material material : {Material::kBark, Material::kCeiling}) {
    world.paints.push_back({.material = material, .width_m = 20.0, .height_m = 20.0, .texel_m = 0.1});
  }
  world.surfaces = surfaces;
  return world;
}

Rendering Draw(const World& world, const Rigid3& world_from_camera = {}) {
  Rendering rendering;
  Renderer(std::make_shared<const World>(world)).Render(Camera(), world_from_camera, 0.0, rendering);
  return rendering;
}

TEST(Renderer, InverseDepthIsThatOfTheSurface) {
  const Rendering front = Draw(Walls({WallAt(5.0, 0)}));
  for (const auto& [x, y] : {std::pair(40, 30), std::pair(0, 0), std::pair(79, 59)}) {
    EXPECT_NEAR(front.inverse_depth.row(y)[x], 0.2F, 1e-4F) << "z, not the distance";
  }
  const Rendering nearer = Draw(Walls({WallAt(5.0, 0)}), {Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0}});
  EXPECT_NEAR(nearer.inverse_depth.row(30)[40], 0.25F, 1e-4F);
}

TEST(Renderer, TheNearerSurfaceHidesTheFartherOneInWhateverOrder) {
  const Rendering near = Draw(Walls({WallAt(5.0, 0)}));
  for (const World& world : {Walls({WallAt(5.0, 0), WallAt(9.0, 1)}), Walls({WallAt(9.0, 1), WallAt(5.0, 0)})}) {
    const Rendering both = Draw(world);
    EXPECT_EQ(both.radiance.pixels, near.radiance.pixels);
    EXPECT_EQ(both.inverse_depth.pixels, near.inverse_depth.pixels);
  }
}

TEST(Renderer, ASurfaceIsSeenFromItsFrontUnlessItHasTwoSides) {
  const Rigid3 behind{ExpSO3({0.0, 3.14159265, 0.0}), {0.0, 0.0, 10.0}};
  Surface wall = WallAt(5.0, 0);
  EXPECT_EQ(Draw(Walls({wall}), behind).inverse_depth.row(30)[40], 0.0F);
  wall.two_sided = true;
  EXPECT_NEAR(Draw(Walls({wall}), behind).inverse_depth.row(30)[40], 0.2F, 1e-4F);
}

TEST(Renderer, TheTwoTrianglesOfASurfaceTogetherAreTheSurface) {
  Surface lower = WallAt(5.0, 0), upper = WallAt(5.0, 0);
  lower.part = SurfacePart::kLower;
  upper.part = SurfacePart::kUpper;
  const Rendering half = Draw(Walls({lower})), both = Draw(Walls({lower, upper})),
                  whole = Draw(Walls({WallAt(5.0, 0)}));
  EXPECT_GT(half.inverse_depth.row(50)[10], 0.0F) << "the corner of the surface is at the bottom left";
  EXPECT_EQ(half.inverse_depth.row(10)[70], 0.0F);
  int num_different = 0;  // a span of pixels that begins elsewhere may choose another level of the paint
  for (size_t i = 0; i < whole.radiance.pixels.size(); ++i) {
    ASSERT_NEAR(both.inverse_depth.pixels[i], whole.inverse_depth.pixels[i], 1e-6F) << "no gap between them";
    num_different += std::abs(both.radiance.pixels[i] - whole.radiance.pixels[i]) > 256 ? 1 : 0;
  }
  EXPECT_LT(num_different, static_cast<int>(whole.radiance.pixels.size() / 20)) << "the same paint at the same place";
}

TEST(Renderer, WhereNothingIsThereIsNoDepth) {
  for (const float inverse_depth : Draw(Walls({})).inverse_depth.pixels) ASSERT_EQ(inverse_depth, 0.0F);
  const Rendering behind = Draw(Walls({WallAt(-5.0, 0)}));
  EXPECT_EQ(behind.inverse_depth.row(30)[40], 0.0F);
}

}  // namespace
}  // namespace tessera
