#include "map/map.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "map/map_editor.h"
#include "support/map_changes.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

TEST(Map, ReplicasOfTheSameDeltasAreEqualAndASnapshotLeadsToTheSame) {
  std::mt19937 generator(1);
  Map owner, replica;
  for (int i = 0; i < 30; ++i) {
    const MapDelta delta = RandomChange(owner, generator);
    ASSERT_THAT(replica.Apply(delta), IsSuccess());
    Map late;
    ASSERT_THAT(late.Apply(owner.Snapshot()), IsSuccess());
    EXPECT_EQ(late.hash(), owner.hash());
    EXPECT_EQ(late.next_delta(), owner.next_delta());
    EXPECT_EQ(late.Sha256Hex(), owner.Sha256Hex());
    EXPECT_EQ(late.closed_loops(), owner.closed_loops());
  }
  EXPECT_EQ(replica.Sha256Hex(), owner.Sha256Hex());
  EXPECT_GT(owner.landmarks().size(), 20);
}

TEST(Map, TheStateDoesNotDependOnHowChangesAreSplit) {
  std::mt19937 generator(2);
  Map owner;
  std::vector<MapDelta> deltas;
  for (int i = 0; i < 12; ++i) deltas.push_back(RandomChange(owner, generator));
  // The same facts in deltas of one change each, in the same order; only the hash of the last is checked.
  Map split;
  const auto apply_one = [&](MapDelta part) {
    part.number = split.next_delta();
    (void)split.Apply(part);
  };
  for (const MapDelta& delta : deltas) {
    for (const auto& x : delta.new_keyframes) apply_one({.new_keyframes = {x}});
    for (const auto& x : delta.moved_keyframes) apply_one({.moved_keyframes = {x}});
    for (const auto& x : delta.changed_landmarks) apply_one({.changed_landmarks = {x}});
    for (const auto& x : delta.removed_observations) apply_one({.removed_observations = {x}});
    for (const auto& x : delta.new_observations) apply_one({.new_observations = {x}});
    for (const auto& x : delta.changed_parents) apply_one({.changed_parents = {x}});
    for (const auto& x : delta.removed_landmarks) apply_one({.removed_landmarks = {x}});
    for (const auto& x : delta.removed_keyframes) apply_one({.removed_keyframes = {x}});
    for (const auto& x : delta.closed_loops) apply_one({.closed_loops = {x}});
  }
  EXPECT_EQ(split.hash(), owner.hash());
  EXPECT_EQ(split.Sha256Hex(), owner.Sha256Hex());
}

TEST(Map, TheHashCoversEveryKeypoint) {
  std::mt19937 generator(5);
  Map map;
  MapDelta delta = RandomChange(map, generator);
  auto features = std::make_shared<FeatureFrame>(*delta.new_keyframes[0].features);
  features->keypoints.back().angle ^= 1;
  delta.new_keyframes[0].features = features;
  Map other;
  EXPECT_THAT(other.Apply(delta), IsFailure(HasSubstr("wrong hash")));
  EXPECT_NE(other.Sha256Hex(), map.Sha256Hex());
}

// Whether a replica takes the delta, once `change` was made to it, for another one.
bool IsNoticed(const std::function<void(MapDelta&)>& change) {
  std::mt19937 generator(6);
  Map owner, replica;
  for (int i = 0; i < 3; ++i) EXPECT_THAT(replica.Apply(RandomChange(owner, generator)), IsSuccess());
  MapDelta delta = RandomChange(owner, generator);  // moves a keyframe, and closes a loop
  change(delta);
  const bool is_noticed = testing::Value(replica.Apply(delta), IsFailure(HasSubstr("wrong hash")));
  EXPECT_EQ(is_noticed, replica.Sha256Hex() != owner.Sha256Hex());
  return is_noticed;
}

TEST(Map, TheHashCoversScalesAndClosedLoops) {
  EXPECT_FALSE(IsNoticed([](MapDelta&) {}));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.new_keyframes[0].scale *= 1.0 + 1e-15; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.moved_keyframes[0].scale *= 1.0 + 1e-15; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.closed_loops[0].scale *= 1.0 + 1e-15; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { ++delta.closed_loops[0].current.value; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { ++delta.closed_loops[0].matched.value; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { ++delta.closed_loops[0].num_points; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.closed_loops.push_back(delta.closed_loops[0]); }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.closed_loops.clear(); }));
}

TEST(Map, TheHashCoversEveryNumberOfALandmark) {
  for (double Landmark::* const number : {&Landmark::depth_sigma, &Landmark::min_distance, &Landmark::max_distance}) {
    EXPECT_TRUE(IsNoticed([number](MapDelta& delta) { delta.changed_landmarks[0].landmark.*number += 1e-12; }));
  }
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.changed_landmarks[0].landmark.position_in_world.y() += 1e-12; }));
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) { delta.changed_landmarks[0].landmark.normal.z() += 1e-12; }));
}

// A keyframe with other intrinsics sees other rays.
TEST(Map, TheHashCoversTheCamera) {
  EXPECT_TRUE(IsNoticed([](MapDelta& delta) {
    auto features = std::make_shared<FeatureFrame>(*delta.new_keyframes[0].features);
    features->calibration.fx_px += 1e-9;
    delta.new_keyframes[0].features = features;
  }));
}

TEST(Map, TheLensChangesInAllKeyframesAndInWhatIsMadeOfThem) {
  SyntheticWorld world(SensorType::kMono);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 3; ++k) planted.Add(k, {k - 1});
  Map replica;
  for (const MapDelta& delta : planted.deltas()) ASSERT_TRUE(replica.Apply(delta));
  const uint64_t before = replica.hash();
  MapEditor editor(planted.map());
  const LensCorrection lens{490.0, 480.0, -0.005};
  editor.ChangeLens(lens);
  ASSERT_TRUE(replica.Apply(editor.Finish({2})));
  Map late;
  ASSERT_TRUE(late.Apply(replica.Snapshot()));
  EXPECT_NE(replica.hash(), before);
  for (const Map* map : {&planted.map(), &replica, &late}) {
    EXPECT_EQ(map->hash(), planted.map().hash());
    EXPECT_EQ(map->lens(), lens);
    map->keyframes().ForEach([&](KeyframeId, const Keyframe& keyframe) {
      EXPECT_EQ(keyframe.features->calibration, WithLens(world.calibration(), lens));
    });
  }
}

TEST(Map, ScaleAndLoopsComeFromTheDeltas) {
  std::mt19937 generator(7);
  Map map;
  std::map<KeyframeId, double> scales;
  std::vector<ClosedLoop> loops;
  for (int i = 0; i < 20; ++i) {
    const MapDelta delta = RandomChange(map, generator);
    for (const auto& added : delta.new_keyframes) scales[added.id] = added.scale;
    for (const auto& moved : delta.moved_keyframes) scales[moved.id] = moved.scale;
    for (const KeyframeId removed : delta.removed_keyframes) scales.erase(removed);
    loops.insert(loops.end(), delta.closed_loops.begin(), delta.closed_loops.end());
  }
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    EXPECT_EQ(keyframe.scale, scales.at(id));
    EXPECT_EQ(keyframe.WorldFromKeyframe().scale, scales.at(id));
  });
  EXPECT_EQ(map.closed_loops(), loops);
}

TEST(Map, RefusesIdsThatLeapAhead) {
  MapDelta delta;
  delta.changed_landmarks.push_back({{int64_t{1} << 40}, {}});
  EXPECT_THAT(Map().Apply(delta), IsFailure(HasSubstr("can't be added")));
}

TEST(Map, CovisibilityCountsSharedLandmarks) {
  std::mt19937 generator(3);
  Map map;
  for (int i = 0; i < 15; ++i) RandomChange(map, generator);
  map.keyframes().ForEach([&](KeyframeId a, const Keyframe& keyframe) {
    std::map<KeyframeId, int32_t> counted;
    for (const LandmarkId landmark : keyframe.landmarks) {
      for (const Observation& observation : map.ObservationsOf(landmark)) {
        if (observation.keyframe != a) ++counted[observation.keyframe];
      }
    }
    std::vector<CovisibleKeyframe> expected;
    for (const auto& [b, num_shared] : counted) expected.push_back({b, num_shared});
    EXPECT_EQ(keyframe.covisible, expected);
    for (const KeyframeId b : {KeyframeId{0}, KeyframeId{3}, KeyframeId{99}})
      EXPECT_EQ(map.NumShared(a, b), counted[b]);
    const std::vector<KeyframeId> ranked = map.Covisible(a, 5, 2);
    for (size_t i = 1; i < ranked.size(); ++i) EXPECT_GE(counted[ranked[i - 1]], counted[ranked[i]]);
  });
}

TEST(Map, SaysWhatIsWrongWithADelta) {
  std::mt19937 generator(4);
  Map map;
  const MapDelta first = RandomChange(map, generator);
  Map replica = map;
  EXPECT_THAT(replica.Apply(first), IsFailure(HasSubstr("was expected")));
  MapDelta wrong;
  wrong.number = map.next_delta();
  wrong.hash = map.hash() + 1;
  EXPECT_THAT(Map(map).Apply(wrong), IsFailure(HasSubstr("wrong hash")));
  wrong.moved_keyframes.push_back({{99}, {}});
  EXPECT_THAT(Map(map).Apply(wrong), IsFailure(HasSubstr("keyframe 99")));
  wrong.moved_keyframes.clear();
  wrong.new_observations.push_back({{0}, {{0}, kKeypointsPerKeyframe}});
  EXPECT_THAT(Map(map).Apply(wrong), IsFailure(HasSubstr("can't observe")));
  wrong.new_observations.clear();
  wrong.removed_landmarks.push_back({0});
  EXPECT_THAT(Map(map).Apply(wrong), IsFailure(HasSubstr("can't be removed"))) << "it is still observed";
}

}  // namespace
}  // namespace tessera
