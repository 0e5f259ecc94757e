// What a depth camera with a projector measures, and where it measures nothing.
#include "simulation/depth_sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tessera {
namespace {

CameraCalibration Camera() {
  return {.width_px = 320,
          .height_px = 120,
          .fx_px = 525.0,
          .fy_px = 525.0,
          .cx_px = 159.5,
          .cy_px = 59.5,
          .depth_unit_m = 0.0001};
}

// Gray all over; the inverse depth by pixel.
template <class Function>
Rendering Scene(double gray, const Function& inverse_depth) {
  Rendering scene{RadianceImage(320, 120), InverseDepthImage(320, 120)};
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 320; ++x) {
      scene.radiance.row(y)[x] = static_cast<uint16_t>(256.0 * gray);
      scene.inverse_depth.row(y)[x] = static_cast<float>(inverse_depth(x, y));
    }
  }
  return scene;
}
Rendering Wall(double z_m, double gray = 120.0) {
  return Scene(gray, [&](int, int) { return 1.0 / z_m; });
}

DepthImage Measure(const Rendering& scene, uint32_t picture = 0) {
  return MeasureDepth(scene, Camera(), DepthSensor{}, 1, picture);
}

// Of the pixels within the border, in meters.
std::vector<double> Measured(const DepthImage& depth) {
  std::vector<double> all;
  for (int y = 0; y < depth.height; ++y) {
    for (int x = 10; x < depth.width - 10; ++x) {
      if (depth.row(y)[x] != 0) all.push_back(1e-4 * depth.row(y)[x]);
    }
  }
  return all;
}

TEST(DepthSensor, TheErrorGrowsWithTheSquareOfTheDepth) {
  for (const double z : {1.03, 2.03, 3.03, 4.03}) {
    const std::vector<double> depths = Measured(Measure(Wall(z)));
    ASSERT_EQ(depths.size(), 120U * 300U);
    double sum = 0.0, sum_squared = 0.0;
    for (const double depth : depths) {
      sum += depth - z;
      sum_squared += (depth - z) * (depth - z);
    }
    const auto num = static_cast<double>(depths.size());
    EXPECT_NEAR(sum / num, 0.0, 0.6e-3 * z * z) << z;
    EXPECT_NEAR(std::sqrt(sum_squared / num), 1.4e-3 * z * z, 0.4e-3 * z * z) << z;
  }
}

TEST(DepthSensor, DepthComesInStepsOfAnEighthOfAPixelOfDisparity) {
  for (const double depth : Measured(Measure(Wall(3.0)))) {
    const double steps = 43.5 / depth / 0.125;
    ASSERT_NEAR(steps, std::round(steps), 0.01);
  }
}

TEST(DepthSensor, MeasuresNeitherTooNearNorTooFarNorInTheDark) {
  EXPECT_TRUE(Measured(Measure(Wall(0.45))).empty());
  EXPECT_TRUE(Measured(Measure(Wall(4.8))).empty());
  EXPECT_TRUE(Measured(Measure(Wall(0.0))).empty()) << "sky";
  EXPECT_TRUE(Measured(Measure(Wall(1.0, 15.0))).empty());
  const size_t num_dim = Measured(Measure(Wall(1.0, 30.0))).size();
  EXPECT_GT(num_dim, 120U * 300U / 4U) << "some of what is dim";
  EXPECT_LT(num_dim, 120U * 300U * 3U / 4U);
}

TEST(DepthSensor, MeasuresNothingAtSteepAngles) {
  // A floor h below the camera, w = y / h: its cosine is about y = (v - cy) / f.
  const Rendering floor = Scene(120.0, [](int, int y) { return std::max(0.0, (y - 59.5) / 525.0) / 0.08; });
  const DepthImage depth = Measure(floor);
  for (int x = 10; x < 310; ++x) ASSERT_EQ(depth.row(110)[x], 0);
  const Rendering slope = Scene(120.0, [](int, int y) { return (1.0 + (y - 59.5) / 525.0) / 1.5; });
  EXPECT_GT(Measured(Measure(slope)).size(), 120U * 290U) << "45 degrees";
}

TEST(DepthSensor, ANearObjectCastsAShadowOfThePatternToItsRight) {
  // 1 m away for columns 100 to 180, the wall 2 m: a shadow of 525 px * 0.075 m * (1 - 1/2) / m = 19.7 px.
  const DepthImage depth = Measure(Scene(120.0, [](int x, int) { return x >= 100 && x < 180 ? 1.0 : 0.5; }));
  for (int y = 0; y < 120; ++y) {
    for (int x = 183; x < 198; ++x) ASSERT_EQ(depth.row(y)[x], 0) << x;
    EXPECT_NEAR(1e-4 * depth.row(y)[205], 2.0, 0.05);
    EXPECT_NEAR(1e-4 * depth.row(y)[140], 1.0, 0.02);
    EXPECT_NEAR(1e-4 * depth.row(y)[90], 2.0, 0.05);
  }
}

TEST(DepthSensor, EdgesFrayByTwoPixels) {
  const DepthImage depth = Measure(Scene(120.0, [](int x, int) { return x >= 100 ? 1.0 : 0.5; }));
  int num_holes = 0, num_wrong = 0;
  for (int y = 0; y < 120; ++y) {
    for (int x = 10; x < 310; ++x) {
      const double z = 1e-4 * depth.row(y)[x];
      const bool is_wrong = z > 0.0 && std::abs(z - (x < 100 ? 2.0 : 1.0)) > 0.3;
      if (std::abs(x - 100) > 2) {
        ASSERT_TRUE(z > 0.0 && !is_wrong) << x;
      }
      num_holes += z == 0.0 ? 1 : 0;
      num_wrong += is_wrong ? 1 : 0;
    }
  }
  EXPECT_GT(num_holes, 20);
  EXPECT_GT(num_wrong, 20);
}

TEST(DepthSensor, DependsOnTheNumberOfThePicture) {
  EXPECT_EQ(Measure(Wall(2.0), 3).pixels, Measure(Wall(2.0), 3).pixels);
  EXPECT_NE(Measure(Wall(2.0), 3).pixels, Measure(Wall(2.0), 4).pixels);
}

}  // namespace
}  // namespace tessera
