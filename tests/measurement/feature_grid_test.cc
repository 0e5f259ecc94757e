#include "measurement/feature_grid.h"

#include <gmock/gmock.h>

#include <limits>
#include <random>

namespace tessera {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kWidth = 200, kHeight = 100;

Keypoint At(float x_px, float y_px) { return {.x_px = x_px, .y_px = y_px}; }

std::vector<int32_t> Window(const FeatureGrid& grid, const Eigen::Vector2d& center_px, double radius_px) {
  std::vector<int32_t> found;
  grid.VisitWindow(center_px, radius_px, {}, [&](const PlacedKeypoint& placed) { found.push_back(placed.index); });
  return found;
}

std::vector<int32_t> Segment(const FeatureGrid& grid, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  std::vector<int32_t> found;
  grid.VisitSegment(from, to, 2.0, {}, [&](const PlacedKeypoint& placed) { found.push_back(placed.index); });
  return found;
}

TEST(FeatureGrid, AWindowHoldsWhatIsWithinTheRadiusInBothCoordinates) {
  const FeatureGrid grid({At(50, 50), At(59, 41), At(60.5F, 50), At(50, 39)}, kWidth, kHeight);
  EXPECT_THAT(Window(grid, {50, 50}, 10.0), testing::UnorderedElementsAre(0, 1));
  EXPECT_THAT(Window(grid, {50, 50}, 10.5), testing::UnorderedElementsAre(0, 1, 2));
}

TEST(FeatureGrid, AWindowFindsWhatASearchOfAllKeypointsFinds) {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<float> x(-5.0F, kWidth + 5.0F), y(-5.0F, kHeight + 5.0F);
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < 500; ++i) keypoints.push_back(At(x(generator), y(generator)));
  const FeatureGrid grid(keypoints, kWidth, kHeight);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector2d center(x(generator), y(generator));
    std::vector<int32_t> expected;
    for (size_t k = 0; k < keypoints.size(); ++k) {
      const bool is_near =
          std::abs(keypoints[k].x_px - center.x()) <= 12.0 && std::abs(keypoints[k].y_px - center.y()) <= 12.0;
      if (is_near) expected.push_back(static_cast<int32_t>(k));
    }
    EXPECT_THAT(Window(grid, center, 12.0), testing::UnorderedElementsAreArray(expected));
  }
}

TEST(FeatureGrid, KeypointsOfACellAreMetInTheirOrder) {
  const FeatureGrid grid({At(70, 5), At(3, 5), At(2, 4), At(4, 3)}, kWidth, kHeight);
  EXPECT_THAT(Window(grid, {0, 0}, 100.0), ElementsAre(1, 2, 3, 0));
}

TEST(FeatureGrid, KeypointsOutsideTheImageBelongToTheNearestCell) {
  const FeatureGrid grid({At(-3, -2), At(203, 104)}, kWidth, kHeight);
  EXPECT_THAT(Window(grid, {0, 0}, 4.0), ElementsAre(0));
  EXPECT_THAT(Window(grid, {200, 100}, 4.0), ElementsAre(1));
}

TEST(FeatureGrid, PositionsThatAreNotFiniteAreNeverMet) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const FeatureGrid grid({At(nan, 5), At(5, infinity), At(5, 5)}, kWidth, kHeight);
  EXPECT_THAT(Window(grid, {100, 50}, 1e9), ElementsAre(2));
  EXPECT_THAT(Window(grid, {0, 0}, std::numeric_limits<double>::infinity()), ElementsAre(2));
}

TEST(FeatureGrid, ASegmentMeetsAllKeypointsNearItAndNoneFarAway) {
  std::vector<Keypoint> keypoints;
  for (int i = 0; i <= 20; ++i) {
    const auto along = static_cast<float>(i) / 20.0F;
    keypoints.push_back(At(20.0F + 160.0F * along, 10.0F + 80.0F * along));
  }
  keypoints.push_back(At(20, 90));
  const FeatureGrid grid(keypoints, kWidth, kHeight);
  const std::vector<int32_t> found = Segment(grid, {20, 10}, {180, 90});
  for (int32_t i = 0; i <= 20; ++i) EXPECT_THAT(found, Contains(i));
  EXPECT_THAT(found, testing::Not(Contains(21)));
  EXPECT_THAT(Segment(grid, {180, 90}, {20, 10}), testing::UnorderedElementsAreArray(found)) << "either way";
}

TEST(FeatureGrid, TakesTheKeypointsThatItIsToldTo) {
  const FeatureGrid grid({At(50, 50), At(51, 50), At(52, 50)}, kWidth, kHeight, [](int32_t i) { return i != 1; });
  EXPECT_THAT(Window(grid, {50, 50}, 10.0), ElementsAre(0, 2));
}

TEST(FeatureGrid, TellsWhatASearchAsksOfAKeypoint) {
  const std::vector<Keypoint> keypoints = {{.x_px = 50.5F, .y_px = 20.0F, .level = 3, .angle = 70}};
  const FeatureGrid grid(keypoints, kWidth, kHeight);
  grid.VisitWindow({50, 20}, 1.0, {}, [](const PlacedKeypoint& placed) {
    EXPECT_EQ(placed.x_px, 50.5F);
    EXPECT_EQ(placed.y_px, 20.0F);
    EXPECT_EQ(placed.level, 3);
    EXPECT_EQ(placed.angle, 70);
  });
  EXPECT_THAT(Window(grid, {50, 20}, 1.0), ElementsAre(0));
}

TEST(FeatureGrid, ASearchMeetsTheLevelsAndOrientationsThatItWants) {
  std::mt19937_64 generator(5);
  std::uniform_int_distribution<int> level(0, 7), angle(0, 255);
  std::vector<Keypoint> keypoints(300, At(50, 50));
  for (Keypoint& keypoint : keypoints) {
    keypoint.level = static_cast<uint8_t>(level(generator));
    keypoint.angle = static_cast<uint8_t>(angle(generator));
  }
  const FeatureGrid grid(keypoints, kWidth, kHeight);
  for (int i = 0; i < 50; ++i) {
    const int wanted_level = level(generator), wanted_angle = angle(generator);
    std::vector<int32_t> expected;
    for (size_t k = 0; k < keypoints.size(); ++k) {
      const int turn = std::abs(keypoints[k].angle - wanted_angle);
      const bool is_near = std::min(turn, 256 - turn) <= 21;
      if (is_near && std::abs(keypoints[k].level - wanted_level) <= 1) expected.push_back(static_cast<int32_t>(k));
    }
    const PatchRange range = PatchRange::Levels(wanted_level - 1, wanted_level + 1).WithAnglesNear(wanted_angle);
    std::vector<int32_t> in_window, on_segment;
    grid.VisitWindow({50, 50}, 1.0, range, [&](const PlacedKeypoint& k) { in_window.push_back(k.index); });
    grid.VisitSegment({40, 40}, {60, 60}, 1.0, range, [&](const PlacedKeypoint& k) { on_segment.push_back(k.index); });
    EXPECT_THAT(in_window, testing::ElementsAreArray(expected));
    EXPECT_THAT(on_segment, testing::ElementsAreArray(expected));
  }
}

TEST(FeatureGrid, AnEmptyGridHoldsNothing) {
  EXPECT_THAT(Window(FeatureGrid(), {0, 0}, 10.0), IsEmpty());
  EXPECT_THAT(Window(FeatureGrid({}, kWidth, kHeight), {50, 50}, 1000.0), IsEmpty());
}

}  // namespace
}  // namespace tessera
