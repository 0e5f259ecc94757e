#include "map/local_window.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "map/map_editor.h"

namespace tessera {
namespace {

// A corridor: keyframe k sees the landmarks 10 k .. 10 k + 39, so neighbors share 30, 20 and 10 of them.
Map Corridor(int num_keyframes) {
  Map map;
  MapEditor editor(map);
  for (int i = 0; i < 10 * num_keyframes + 40; ++i) editor.AddLandmark({});
  for (int64_t k = 0; k < num_keyframes; ++k) {
    auto features = std::make_shared<FeatureFrame>();
    features->keypoints.resize(40);
    features->descriptors.resize(40);
    editor.AddKeyframe({k}, {k - 1}, {}, features);
    for (int32_t i = 0; i < 40; ++i) editor.AddObservation({10 * k + i}, {{k}, i});
  }
  return map;
}

TEST(LocalWindow, HoldsNeighborsWhatTheySeeAndWhoElseSeesIt) {
  const Map map = Corridor(12);
  const LocalWindow window =
      SelectLocalWindow(map, {6}, {.max_inner_keyframes = 5, .min_shared_landmarks = 15, .max_outer_keyframes = 4});
  EXPECT_EQ(window.inner, (std::vector<KeyframeId>{{4}, {5}, {6}, {7}, {8}}));
  EXPECT_EQ(window.outer, (std::vector<KeyframeId>{{2}, {3}, {9}, {10}})) << "3 and 9 share 30, 2 and 10 share 20";
  EXPECT_EQ(window.landmarks.front(), LandmarkId{40});
  EXPECT_EQ(window.landmarks.back(), LandmarkId{119});
  EXPECT_TRUE(std::is_sorted(window.landmarks.begin(), window.landmarks.end()));
}

TEST(LocalWindow, LeavesOutLandmarksThatOneKeyframeSees) {
  const Map map = Corridor(2);
  const LocalWindow window = SelectLocalWindow(map, {1}, {});
  EXPECT_EQ(window.inner, (std::vector<KeyframeId>{{0}, {1}}));
  EXPECT_TRUE(window.outer.empty());
  EXPECT_EQ(window.landmarks.front(), LandmarkId{10});
  EXPECT_EQ(window.landmarks.back(), LandmarkId{39});
}

TEST(LocalWindow, NeighborsNeedEnoughInCommon) {
  const Map map = Corridor(6);
  const LocalWindow window = SelectLocalWindow(map, {0}, {.min_shared_landmarks = 25});
  EXPECT_EQ(window.inner, (std::vector<KeyframeId>{{0}, {1}}));
}

}  // namespace
}  // namespace tessera
