#include "features/right_turn.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

namespace tessera {
namespace {

using Pairs = std::vector<std::vector<RowOffset>>;

CameraCalibration Camera() {
  return {.sensor = SensorType::kStereo,
          .width_px = 752,
          .height_px = 480,
          .fx_px = 450.0,
          .fy_px = 460.0,
          .cx_px = 370.0,
          .cy_px = 250.0,
          .baseline_m = 0.11};
}

// Where a point that should be seen at (x, y) is seen by a camera that is turned, exactly.
Eigen::Vector2d SeenAt(const CameraCalibration& camera, double pitch, double twist, double x_px, double y_px) {
  const Eigen::Vector3d ray((x_px - camera.cx_px) / camera.fx_px, (y_px - camera.cy_px) / camera.fy_px, 1.0);
  const Eigen::Matrix3d straight_from_turned =
      (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(twist, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  const Eigen::Vector3d seen = straight_from_turned.transpose() * ray;
  return {camera.fx_px * seen.x() / seen.z() + camera.cx_px, camera.fy_px * seen.y() / seen.z() + camera.cy_px};
}

// Offsets of such a camera, each wrong by 0.2 px, one in ten by anything. `shifts_px`: of each pair besides.
Pairs PairsOf(double pitch, double twist, const std::vector<double>& shifts_px, int num_offsets = 150) {
  const CameraCalibration camera = Camera();
  std::mt19937 generator(3);
  std::normal_distribution<double> noise(0.0, 0.2);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  Pairs pairs;
  for (const double shift_px : shifts_px) {
    std::vector<RowOffset>& pair = pairs.emplace_back();
    for (int i = 0; i < num_offsets; ++i) {
      const double x_px = camera.width_px * share(generator), y_px = camera.height_px * share(generator);
      double offset_px = SeenAt(camera, pitch, twist, x_px, y_px).y() - y_px + shift_px + noise(generator);
      if (i % 10 == 0) offset_px = 12.0 * share(generator) - 6.0;
      pair.push_back({x_px, y_px, offset_px});
    }
  }
  return pairs;
}

TEST(RightTurn, ShiftsPixelsAsTheTurnedCameraDoes) {
  const CameraCalibration camera = Camera();
  for (const auto& [pitch, twist] : {std::pair(0.004, 0.0), std::pair(0.0, 0.006), std::pair(-0.003, 0.002)}) {
    for (const double x_px : {0.0, 300.0, 751.0}) {
      for (const double y_px : {0.0, 200.0, 479.0}) {
        const Eigen::Vector2d seen_px = SeenAt(camera, pitch, twist, x_px, y_px);
        const Eigen::Vector2d shift_px = RightTurn{pitch, twist}.Shift_px(camera, x_px, y_px);
        EXPECT_LT((Eigen::Vector2d(x_px, y_px) + shift_px - seen_px).norm(), 0.05) << x_px << " " << y_px;
      }
    }
  }
}

TEST(RightTurn, IsFoundAmongFalseOffsets) {
  for (const auto& [pitch, twist] : {std::pair(0.004, -0.002), std::pair(-0.0005, 0.008), std::pair(0.0, 0.0)}) {
    const auto turn = FindRightTurn(PairsOf(pitch, twist, {0.0, 0.0, 0.0, 0.0}), Camera());
    ASSERT_TRUE(turn.has_value());
    EXPECT_NEAR(turn->pitch, pitch, 1e-4);
    EXPECT_NEAR(turn->twist, twist, 2e-4);
  }
}

TEST(RightTurn, IsNotFoundWherePairsContradictEachOther) {
  // A camera that moves up and down, and whose eyes aren't triggered together.
  EXPECT_FALSE(FindRightTurn(PairsOf(0.0, 0.0, {1.0, -0.6, 0.1, -0.9}), Camera()).has_value());
  EXPECT_TRUE(FindRightTurn(PairsOf(0.0, 0.0, {0.05, -0.05, 0.1, 0.0}), Camera()).has_value());
}

TEST(RightTurn, NeedsEnoughOfThem) {
  EXPECT_FALSE(FindRightTurn({}, Camera()).has_value());
  EXPECT_FALSE(FindRightTurn(PairsOf(0.004, 0.0, {0.0}), Camera()).has_value());
  EXPECT_FALSE(FindRightTurn(PairsOf(0.004, 0.0, {0.0, 0.0}, 39), Camera()).has_value());
  EXPECT_TRUE(FindRightTurn(PairsOf(0.004, 0.0, {0.0, 0.0}, 40), Camera()).has_value());
}

TEST(RightTurn, LeavesRowsThatAreStretched) {
  Pairs pairs = PairsOf(0.002, 0.0, {0.0, 0.0, 0.0});
  for (auto& pair : pairs) {
    for (RowOffset& offset : pair) offset.offset_px += 0.01 * (offset.y_px - Camera().cy_px);
  }
  const auto turn = FindRightTurn(pairs, Camera());
  ASSERT_TRUE(turn.has_value());
  EXPECT_NEAR(turn->pitch, 0.002, 1e-4);
}

TEST(RightTurn, TellsTheLargestOffsetOfARow) {
  EXPECT_EQ(RightTurn{}.LargestOffset_px(Camera()), 0.0);
  // At the right end of a row: (751 - 370) / 450 of the focal length from the axis.
  EXPECT_NEAR((RightTurn{0.0, 0.002}.LargestOffset_px(Camera())), 460.0 * 0.002 * 381.0 / 450.0, 1e-9);
}

}  // namespace
}  // namespace tessera
