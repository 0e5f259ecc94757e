// Bundle adjustment of a whole part of the map.
#include "optimization/global_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <stdexcept>

#include "map/map_editor.h"
#include "map/spanning_tree.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// How far the path leaves the truth at keyframe k of 20: a curve of one meter.
Rigid3 Deformation(int64_t k) {
  const double way = static_cast<double>(k) / 20.0;
  return {ExpSO3({0.0, 0.05 * way * way, 0.0}), {way * way, 0.0, 0.0}};
}

double WorstError(const GlobalAdjustment& adjustment, const PlantedMap& planted) {
  double worst = 0.0;
  for (const GlobalAdjustment::Pose& pose : adjustment.poses) {
    worst = std::max(worst, (pose.world_from_camera.translation - planted.Truth(pose.id).translation).norm());
  }
  return worst;
}

TEST(GlobalAdjustment, BringsADeformedMapNearerToTheTruth) {
  for (const SensorType sensor : {SensorType::kStereo, SensorType::kMono}) {
    SyntheticWorld world(sensor, 0.3);
    PlantedMap planted(world);
    for (int64_t k = 0; k < 20; ++k) planted.Add(k, {k - 1}, 0);
    Map& map = planted.map();
    MapEditor editor(map);
    for (int64_t k = 0; k < 20; ++k) editor.MoveKeyframe({k}, Deformation(k) * planted.Truth({k}));
    std::map<LandmarkId, Landmark> moved;
    map.landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
      moved[id] = landmark;
      moved[id].position_in_world =
          Deformation(map.ObservationsOf(id).front().keyframe.value) * landmark.position_in_world;
    });
    for (const auto& [id, landmark] : moved) editor.ChangeLandmark(id, landmark);
    (void)editor.Finish({19});
    const double before = planted.WorstKeyframe(map);
    ASSERT_GT(before, 0.5);
    const GlobalAdjustment adjustment = AdjustGlobally(map, {12}, GlobalBundleOptions());
    ASSERT_TRUE(adjustment.is_usable);
    EXPECT_EQ(adjustment.answers, KeyframeId{12});
    EXPECT_EQ(adjustment.delta, map.next_delta() - 1);
    EXPECT_EQ(adjustment.poses.size(), 20U);
    // Mono keeps the root and the distance of the second keyframe, so the scale is known to a few percent.
    const double share = sensor == SensorType::kStereo ? 0.1 : 0.3;
    EXPECT_LT(WorstError(adjustment, planted), share * before) << ToString(sensor);
  }
}

TEST(GlobalAdjustment, MovesOnlyThePartThatWasAskedFor) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k - 1}, 0);
  for (int64_t k = 4; k < 8; ++k) planted.Add(k - 4, k == 4 ? KeyframeId{} : KeyframeId{k - 1}, 1);
  const Map& map = planted.map();
  const GlobalAdjustment adjustment = AdjustGlobally(map, {6}, GlobalBundleOptions());
  ASSERT_EQ(adjustment.poses.size(), 4U);
  for (const GlobalAdjustment::Pose& pose : adjustment.poses) {
    EXPECT_EQ(RootOf(map, pose.id), KeyframeId{4});
    if (pose.id == KeyframeId{4}) {
      EXPECT_THAT(pose.world_from_camera, IsNear(map.FindKeyframe({4})->world_from_camera, 1e-12)) << "the root";
    }
  }
  for (const GlobalAdjustment::Point& point : adjustment.points) {
    EXPECT_GE(map.ObservationsOf(point.id).front().keyframe, KeyframeId{4});
  }
}

TEST(GlobalAdjustment, EveryPartIsAdjustedAsByItself) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k - 1}, 0);
  for (int64_t k = 4; k < 8; ++k) planted.Add(k - 4, k == 4 ? KeyframeId{} : KeyframeId{k - 1}, 1);
  planted.Add(9, {}, 2);  // too little to adjust
  const Map& map = planted.map();
  const GlobalAdjustment all = AdjustEveryPart(map, GlobalBundleOptions());
  ASSERT_TRUE(all.is_usable);
  EXPECT_EQ(all.answers, map.answered());
  EXPECT_EQ(all.delta, map.next_delta() - 1);
  ASSERT_EQ(all.poses.size(), 8U);
  size_t next = 0, num_points = 0;
  for (const KeyframeId asked : {KeyframeId{2}, KeyframeId{6}}) {
    const GlobalAdjustment part = AdjustGlobally(map, asked, GlobalBundleOptions());
    num_points += part.points.size();
    for (const GlobalAdjustment::Pose& pose : part.poses) {
      EXPECT_EQ(all.poses[next].id, pose.id);
      EXPECT_THAT(all.poses[next].world_from_camera, IsNear(pose.world_from_camera, 0.0));
      ++next;
    }
  }
  EXPECT_EQ(all.points.size(), num_points);
  EXPECT_TRUE(std::ranges::is_sorted(all.points, {}, &GlobalAdjustment::Point::id));
}

TEST(GlobalAdjustment, IsNotUsableWithASingleKeyframe) {
  SyntheticWorld world(SensorType::kStereo);
  PlantedMap planted(world);
  planted.Add(0, {});
  EXPECT_FALSE(AdjustGlobally(planted.map(), {0}, GlobalBundleOptions()).is_usable);
  EXPECT_FALSE(AdjustEveryPart(planted.map(), GlobalBundleOptions()).is_usable);
  EXPECT_FALSE(AdjustEveryPart(Map(), GlobalBundleOptions()).is_usable);
}

TEST(GlobalAdjustment, RefusesAKeyframeThatIsNotInTheMap) {
  EXPECT_THROW((void)AdjustGlobally(Map(), {99}, GlobalBundleOptions()), std::invalid_argument);
}

}  // namespace
}  // namespace tessera
