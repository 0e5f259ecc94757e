// What a simulated camera adds to a perfect picture.
#include "simulation/camera_effects.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

constexpr CameraEffects kNone{.exposure_s = 0.0,
                              .exposure_drift = 0.0,
                              .vignetting = 0.0,
                              .read_noise = 0.0,
                              .shot_noise = 0.0,
                              .depth_noise = 0.0};

CameraCalibration Camera() {
  return {.width_px = 80,
          .height_px = 60,
          .fx_px = 50.0,
          .fy_px = 50.0,
          .cx_px = 40.0,
          .cy_px = 30.0,
          .depth_unit_m = 0.001};
}

// Gray 100 on the left, `right_gray` from column 40 on; all of it 5 m away.
Rendering Edge(int right_gray = 100) {
  Rendering rendering{RadianceImage(80, 60), InverseDepthImage(80, 60)};
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      rendering.radiance.row(y)[x] = static_cast<uint16_t>(256 * (x < 40 ? 100 : right_gray));
      rendering.inverse_depth.row(y)[x] = 0.2F;
    }
  }
  return rendering;
}

GrayImage Take(const Rendering& rendering, const CameraEffects& effects, const CameraVelocity& velocity = {},
               uint32_t picture = 0) {
  return EffectsPipeline(Camera(), effects, 1).Apply(rendering, velocity, 0.0, picture);
}

// Columns whose gray is neither that of the left nor that of the right.
int EdgeWidth(const GrayImage& image) {
  int width = 0;
  for (int x = 2; x < 78; ++x) width += image.row(30)[x] > 105 && image.row(30)[x] < 195 ? 1 : 0;
  return width;
}

TEST(CameraEffects, WithoutAnyTheGrayIsThatOfTheRendering) {
  for (const uint8_t gray : Take(Edge(), kNone).pixels) ASSERT_EQ(gray, 100);
}

TEST(CameraEffects, ThePointSpreadSoftensAnEdgeByAPixelOnEachSide) {
  const GrayImage image = Take(Edge(200), kNone);
  EXPECT_EQ(image.row(30)[38], 100);
  EXPECT_GT(image.row(30)[39], 100);
  EXPECT_LT(image.row(30)[40], 200);
  EXPECT_EQ(image.row(30)[41], 200);
}

// 50 px * 1 rad/s * 0.1 s = 5 px.
TEST(CameraEffects, MotionBlursAlongTheApparentMotionForTheTimeOfTheExposure) {
  CameraEffects effects = kNone;
  effects.exposure_s = 0.1;
  const CameraVelocity turn{.angular_radps = {0.0, 1.0, 0.0}}, nod{.angular_radps = {1.0, 0.0, 0.0}};
  EXPECT_NEAR(EdgeWidth(Take(Edge(200), effects, turn)), 5, 1);
  EXPECT_LE(EdgeWidth(Take(Edge(200), effects, nod)), 2) << "along the edge there is nothing to blur";
  EXPECT_LE(EdgeWidth(Take(Edge(200), effects)), 2) << "a camera at rest";
}

// 50 px * 2 m/s * 0.1 s / 5 m = 2 px; a fifth of the depth: 10 px.
TEST(CameraEffects, NearSurfacesBlurMoreThanFarOnes) {
  CameraEffects effects = kNone;
  effects.exposure_s = 0.1;
  const CameraVelocity sideways{.linear_mps = {2.0, 0.0, 0.0}};
  Rendering near = Edge(200);
  for (float& inverse_depth : near.inverse_depth.pixels) inverse_depth = 1.0F;
  EXPECT_GT(EdgeWidth(Take(near, effects, sideways)), EdgeWidth(Take(Edge(200), effects, sideways)) + 3);
}

TEST(CameraEffects, VignettingDarkensTheCorners) {
  CameraEffects effects = kNone;
  effects.vignetting = 0.2;
  const GrayImage image = Take(Edge(), effects);
  EXPECT_EQ(image.row(30)[40], 100);
  EXPECT_EQ(image.row(0)[0], 80);
}

TEST(CameraEffects, NoiseHasTheVarianceOfReadAndShotNoise) {
  CameraEffects effects = kNone;
  effects.read_noise = 2.0;
  effects.shot_noise = 0.05;
  double sum_squared = 0.0;
  const GrayImage image = Take(Edge(), effects);
  for (const uint8_t gray : image.pixels) sum_squared += (gray - 100.0) * (gray - 100.0);
  const double expected = 2.0 * 2.0 + 0.05 * 100.0;
  EXPECT_NEAR(sum_squared / static_cast<double>(image.pixels.size()), expected, 0.1 * expected);
}

TEST(CameraEffects, NoiseDependsOnTheNumberOfThePictureAlone) {
  const CameraEffects effects;
  EXPECT_EQ(Take(Edge(), effects, {}, 7).pixels, Take(Edge(), effects, {}, 7).pixels);
  EXPECT_NE(Take(Edge(), effects, {}, 7).pixels, Take(Edge(), effects, {}, 8).pixels);
}

TEST(CameraEffects, DepthIsCountedInItsUnit) {
  Rendering rendering = Edge();
  rendering.inverse_depth.row(0)[0] = 0.0F;           // sky
  rendering.inverse_depth.row(0)[1] = 1.0F / 100.0F;  // 100 m do not fit into 16 bits of millimeters
  const DepthImage depth = EffectsPipeline(Camera(), kNone, 1).Depth(rendering, 0);
  EXPECT_EQ(depth.row(30)[40], 5000);
  EXPECT_EQ(depth.row(0)[0], 0);
  EXPECT_EQ(depth.row(0)[1], 0);
}

}  // namespace
}  // namespace tessera
