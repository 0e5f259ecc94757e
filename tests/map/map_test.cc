#include "map/map.h"

#include <gtest/gtest.h>

#include <random>

#include "map/random_changes.h"

namespace tessera {
namespace {

TEST(Map, ReplicasOfTheSameDeltasAreEqualAndASnapshotLeadsToTheSame) {
  std::mt19937 generator(1);
  Map owner, replica;
  for (int i = 0; i < 30; ++i) {
    const MapDelta delta = RandomChange(owner, generator);
    ASSERT_EQ(replica.Apply(delta), "");
    Map late;
    ASSERT_EQ(late.Apply(owner.Snapshot()), "");
    EXPECT_EQ(late.hash(), owner.hash());
    EXPECT_EQ(late.next_delta(), owner.next_delta());
    EXPECT_EQ(late.Sha256Hex(), owner.Sha256Hex());
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
  EXPECT_NE(other.Apply(delta).find("wrong hash"), std::string::npos);
  EXPECT_NE(other.Sha256Hex(), map.Sha256Hex());
}

TEST(Map, RefusesIdsThatLeapAhead) {
  MapDelta delta;
  delta.changed_landmarks.push_back({{int64_t{1} << 40}, {}});
  EXPECT_NE(Map().Apply(delta).find("can't be added"), std::string::npos);
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
    EXPECT_EQ(counted, keyframe.covisible);
    const std::vector<KeyframeId> ranked = map.Covisible(a, 5, 2);
    for (size_t i = 1; i < ranked.size(); ++i) EXPECT_GE(counted[ranked[i - 1]], counted[ranked[i]]);
  });
}

TEST(Map, SaysWhatIsWrongWithADelta) {
  std::mt19937 generator(4);
  Map map;
  const MapDelta first = RandomChange(map, generator);
  Map replica = map;
  EXPECT_NE(replica.Apply(first).find("was expected"), std::string::npos);
  MapDelta wrong;
  wrong.number = map.next_delta();
  wrong.hash = map.hash() + 1;
  EXPECT_NE(Map(map).Apply(wrong).find("wrong hash"), std::string::npos);
  wrong.moved_keyframes.push_back({{99}, {}});
  EXPECT_NE(Map(map).Apply(wrong).find("keyframe 99"), std::string::npos);
  wrong.moved_keyframes.clear();
  wrong.new_observations.push_back({{0}, {{0}, kKeypointsPerKeyframe}});
  EXPECT_NE(Map(map).Apply(wrong).find("can't observe"), std::string::npos);
  wrong.new_observations.clear();
  wrong.removed_landmarks.push_back({0});
  EXPECT_NE(Map(map).Apply(wrong).find("can't be removed"), std::string::npos) << "it is still observed";
}

}  // namespace
}  // namespace tessera
