// A right camera that doesn't stand as the calibration says.
#include <gtest/gtest.h>

#include "core/errors.h"
#include "simulation/simulation.h"

namespace tessera {
namespace {

CameraFrame FrameOf(const char* name) {
  return Simulation(ParseSimulation(name), SensorType::kStereo).Render(FrameId{20});
}

// Mean of |right(x + shift) - other(x)| over the row in the middle.
double RowDifference(const GrayImage& right, const GrayImage& other, int shift) {
  const int y = right.height / 2, margin = 40;
  double sum = 0.0;
  for (int x = margin; x < right.width - margin; ++x) sum += std::abs(right.row(y)[x + shift] - other.row(y)[x]);
  return sum / (right.width - 2 * margin);
}

TEST(Squint, TurnsTheRightCameraInwardsAndLeavesTheLeftOne) {
  const CameraFrame straight = FrameOf("room"), squints = FrameOf("room,squint=1"), twisted = FrameOf("room,twist=1");
  EXPECT_EQ(straight.left.pixels, squints.left.pixels);
  EXPECT_EQ(straight.left.pixels, twisted.left.pixels);
  // One degree at 525 px: what it shows moves 9 px to the right.
  EXPECT_LT(RowDifference(squints.right, straight.right, 9), 0.6 * RowDifference(squints.right, straight.right, 0));
  EXPECT_LT(RowDifference(squints.right, straight.right, 9), 0.6 * RowDifference(squints.right, straight.right, -9));
  EXPECT_NE(straight.right.pixels, twisted.right.pixels);
  EXPECT_THROW(ParseSimulation("room,squint=3"), InputError);
}

TEST(Squint, PitchLetsTheRightCameraLookUp) {
  const CameraFrame straight = FrameOf("room"), pitched = FrameOf("room,pitch=1");
  EXPECT_EQ(straight.left.pixels, pitched.left.pixels);
  // One degree at 525 px: what it shows moves 9 px down.
  const auto difference = [&](int rows) {
    constexpr int kMargin = 40;
    double sum = 0.0;
    for (int y = kMargin; y < straight.right.height - kMargin; ++y) {
      for (int x = kMargin; x < straight.right.width - kMargin; ++x) {
        sum += std::abs(pitched.right.row(y + rows)[x] - straight.right.row(y)[x]);
      }
    }
    return sum;
  };
  EXPECT_LT(difference(9), 0.6 * difference(0));
  EXPECT_LT(difference(9), 0.6 * difference(-9));
  EXPECT_THROW(ParseSimulation("room,pitch=3"), InputError);
}

}  // namespace
}  // namespace tessera
