// What surfaces look like: canvases, textures and materials.
#include "simulation/paint.h"

#include <gtest/gtest.h>

#include "simulation/canvas.h"
#include "simulation/paint_store.h"

namespace tessera {
namespace {

constexpr Grain kSmooth{.fine = 0.0, .coarse = 0.0};

TEST(Canvas, IsMeasuredInMetersFromTheBottomLeft) {
  Canvas canvas(2.0, 1.0, 0.1, 1, 100.0, kSmooth);
  ASSERT_EQ(canvas.image().width, 20);
  ASSERT_EQ(canvas.image().height, 10);
  canvas.Fill({.x_m = 0.0, .y_m = 0.0, .width_m = 0.5, .height_m = 0.2}, 200.0, kSmooth);
  EXPECT_EQ(canvas.image().row(9)[0], 200) << "bottom left";
  EXPECT_EQ(canvas.image().row(9)[4], 200);
  EXPECT_EQ(canvas.image().row(9)[5], 100);
  EXPECT_EQ(canvas.image().row(7)[0], 100);
}

TEST(Canvas, WhatLiesOutsideIsCutOff) {
  Canvas canvas(1.0, 1.0, 0.1, 1, 100.0, kSmooth);
  canvas.Fill({.x_m = -5.0, .y_m = 0.5, .width_m = 20.0, .height_m = 20.0}, 200.0, kSmooth);
  EXPECT_EQ(canvas.image().row(0)[0], 200);
  EXPECT_EQ(canvas.image().row(9)[9], 100);
}

TEST(Texture, EachLevelHalvesTheOneBeforeAndKeepsItsMean) {
  GrayImage paint(64, 16);
  for (size_t i = 0; i < paint.pixels.size(); ++i) paint.pixels[i] = static_cast<uint8_t>(i % 2 == 0 ? 80 : 120);
  const Texture texture = MakeTexture(paint, {});
  ASSERT_GE(texture.levels.size(), 2U);
  for (size_t level = 1; level < texture.levels.size(); ++level) {
    EXPECT_EQ(texture.levels[level].width, texture.levels[level - 1].width / 2);
    EXPECT_GE(texture.levels[level].height, 2);
    for (const uint8_t gray : texture.levels[level].pixels) EXPECT_NEAR(gray, 100, 1);
  }
  EXPECT_TRUE(texture.cover.empty());
}

TEST(Paint, IsAFunctionOfItsSpecification) {
  for (const Material material :
       {Material::kFacade, Material::kFoliage, Material::kCarSide, Material::kBooks, Material::kField,
        Material::kScreen, Material::kPaper, Material::kPackage, Material::kCloth}) {
    const PaintSpec spec{.material = material, .seed = 7, .width_m = 3.0, .height_m = 2.0};
    PaintSpec other = spec;
    other.seed = 8;
    const Texture texture = Paint(spec, nullptr);
    EXPECT_EQ(texture.levels[0].width, 150);
    EXPECT_EQ(texture.levels[0].height, 100);
    EXPECT_EQ(texture.levels[0].pixels, Paint(spec, nullptr).levels[0].pixels);
    EXPECT_NE(texture.levels[0].pixels, Paint(other, nullptr).levels[0].pixels);
    EXPECT_EQ(texture.cover.empty(), material != Material::kFoliage) << "one looks through leaves alone";
  }
}

TEST(PaintStore, GivesThePaintOfTheNumberAndKeepsIt) {
  World world;
  for (const uint32_t seed : {1, 2}) {
    world.paints.push_back({.material = Material::kPaper, .seed = seed, .width_m = 0.2, .height_m = 0.3});
  }
  PaintStore store(std::make_shared<const World>(world));
  const Texture& second = store.Get(1);
  EXPECT_EQ(second.levels[0].pixels, Paint(world.paints[1], nullptr).levels[0].pixels);
  EXPECT_NE(store.Get(0).levels[0].pixels, second.levels[0].pixels);
  EXPECT_EQ(&store.Get(1), &second);
}

}  // namespace
}  // namespace tessera
