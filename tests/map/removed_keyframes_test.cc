#include "map/removed_keyframes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "map/map_editor.h"
#include "map/spanning_tree.h"
#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

const Sim3 kCorrection{1.7, ExpSO3({0.3, -0.2, 0.9}), {4.0, -1.0, 2.0}};  // new_world_from_old_world

Sim3 WorldFromKeyframe(int64_t id, double scale) {
  const auto step = static_cast<double>(id);
  return Sim3::From({ExpSO3({0.1 * step, 0.05, -0.2 * step}), {step, 0.3 * step, 0.1}}, scale);
}

// Keyframes 0 <- 1 <- 2 <- 3, whose surroundings were enlarged by different factors.
Map Chain() {
  Map map;
  MapEditor editor(map);
  for (int64_t id = 0; id < 4; ++id) {
    editor.AddKeyframe({id}, {id - 1}, WorldFromKeyframe(id, 1.0 + 0.25 * static_cast<double>(id)),
                       PlainFeatures(id, 1));
  }
  (void)editor.Finish({3});
  return map;
}

void ExpectNear(const Sim3& a, const Sim3& b) {
  EXPECT_NEAR(a.scale, b.scale, 1e-12 * b.scale);
  EXPECT_LT((a.translation - b.translation).norm(), 1e-12);
  EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-7);
}

// The mapper's step: removes keyframes, whose children pass to their parents.
MapDelta Remove(Map& map, const std::vector<KeyframeId>& ids, RemovedKeyframes& removed) {
  MapDelta delta;
  for (const KeyframeId id : ids) {
    const KeyframeId parent = map.FindKeyframe(id)->parent;
    map.keyframes().ForEach([&](KeyframeId child, const Keyframe& keyframe) {
      if (keyframe.parent == id) delta.changed_parents.push_back({child, parent});
    });
    delta.removed_keyframes.push_back(id);
  }
  delta = WithHash(map, delta);
  removed.Remember(map, delta);
  EXPECT_THAT(map.Apply(delta), IsSuccess());
  return delta;
}

void Correct(Map& map, const Sim3& new_from_old) {
  MapEditor editor(map);
  map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
    editor.MoveKeyframe(id, new_from_old * keyframe.WorldFromKeyframe());
  });
  (void)editor.Finish({9});
}

TEST(RemovedKeyframes, StandWhereTheyStoodWhileTheMapRests) {
  Map map = Chain();
  RemovedKeyframes removed;
  Remove(map, {{2}}, removed);
  Remove(map, {{1}}, removed);
  for (int64_t id = 0; id < 4; ++id) {
    ASSERT_TRUE(removed.Find(map, {id}).has_value());
    ExpectNear(*removed.Find(map, {id}), WorldFromKeyframe(id, 1.0 + 0.25 * static_cast<double>(id)));
  }
  EXPECT_EQ(removed.Successor(map, {2}), KeyframeId{0});
  EXPECT_EQ(removed.Successor(map, {3}), KeyframeId{3});
  EXPECT_FALSE(removed.Find(map, {7}).has_value());
  EXPECT_FALSE(removed.Successor(map, {7}).valid());
}

TEST(RemovedKeyframes, GoAlongWhenTheMapIsBent) {
  for (const bool at_once : {false, true}) {
    Map map = Chain();
    RemovedKeyframes removed;
    if (at_once) {
      Remove(map, {{1}, {2}}, removed);
    } else {
      Remove(map, {{1}}, removed);
      Remove(map, {{2}}, removed);
    }
    Correct(map, kCorrection);
    for (int64_t id = 1; id < 3; ++id) {
      ExpectNear(*removed.Find(map, {id}), kCorrection * WorldFromKeyframe(id, 1.0 + 0.25 * static_cast<double>(id)));
    }
  }
}

// The owner tells, to the last bit, what a follower remembers that was there all the time.
TEST(RemovedKeyframes, OneThatCameLateIsToldTheSame) {
  for (const bool at_once : {false, true}) {
    Map map = Chain();
    RemovedKeyframes followed, told;
    KeyframePoses poses;
    poses.Begin(map);
    std::vector<std::vector<KeyframeId>> steps{{{2}}, {{1}}};
    if (at_once) steps = {{{1}, {2}}};
    for (const auto& ids : steps) {
      for (const KeyframeLink& link : poses.Update(Remove(map, ids, followed), map).links) told.Add(link);
      MapEditor editor(map);
      map.keyframes().ForEach([&](KeyframeId id, const Keyframe& keyframe) {
        editor.MoveKeyframe(id, kCorrection * keyframe.WorldFromKeyframe());
      });
      EXPECT_TRUE(poses.Update(editor.Finish({9}), map).links.empty());
    }
    for (int64_t id = 0; id < 4; ++id) {
      const Sim3 a = *followed.Find(map, {id}), b = *told.Find(map, {id});
      EXPECT_EQ(a.scale, b.scale);
      EXPECT_EQ(a.translation, b.translation);
      EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
    }
  }
}

// One delta joins a part to the map and moves it there, and its first keyframes, of which the map shows as much, go.
TEST(RemovedKeyframes, TheFirstKeyframeOfAPartGoesAlongWhenThePartIsJoined) {
  Map map = Chain();
  MapEditor begins(map);
  for (int64_t id = 4; id < 8; ++id) {
    begins.AddKeyframe({id}, id == 4 ? KeyframeId{} : KeyframeId{id - 1}, WorldFromKeyframe(id, 1.0),
                       PlainFeatures(id, 1));
  }
  (void)begins.Finish({7});
  Map followers_map = map;
  KeyframePoses poses;
  poses.Begin(map);

  MapEditor joins(map);
  for (int64_t id = 4; id < 8; ++id) joins.MoveKeyframe({id}, kCorrection * WorldFromKeyframe(id, 1.0));
  AttachTree({7}, {2}, joins);
  for (const int64_t id : {4, 5}) joins.RemoveKeyframe({id});
  const MapDelta delta = joins.Finish({8});
  RemovedKeyframes followed, told;
  followed.Remember(followers_map, delta);
  ASSERT_THAT(followers_map.Apply(delta), IsSuccess());
  for (const KeyframeLink& link : poses.Update(delta, map).links) told.Add(link);
  for (int64_t id = 4; id < 8; ++id) {
    for (const RemovedKeyframes& removed : {followed, told}) {
      ASSERT_TRUE(removed.Find(followers_map, {id}).has_value()) << id;
      ExpectNear(*removed.Find(followers_map, {id}), kCorrection * WorldFromKeyframe(id, 1.0));
    }
    EXPECT_EQ(followed.Find(followers_map, {id})->translation, told.Find(map, {id})->translation);
    EXPECT_EQ(followed.Successor(followers_map, {id}), KeyframeId{std::max<int64_t>(id, 6)});
  }
}

TEST(RemovedKeyframes, TiesInACircleAreIgnored) {
  RemovedKeyframes removed;
  for (const auto& [keyframe, parent] : {std::pair(5, 6), std::pair(6, 7), std::pair(7, 5), std::pair(8, 8)}) {
    removed.Add({{keyframe}, {parent}, {}});
  }
  EXPECT_FALSE(removed.Find(Map(), {5}).has_value());
  EXPECT_FALSE(removed.Find(Map(), {8}).has_value());
}

// A frame's pose is stored relative to a keyframe, in its units of that time. What it saw then, it sees at the same
// pixels after any correction, at a distance that grows with the map.
TEST(RemovedKeyframes, APoseKeepsItsPlaceInItsSurroundings) {
  Map map = Chain();
  RemovedKeyframes removed;
  const Rigid3 reference_from_camera{ExpSO3({0.0, 0.4, 0.1}), {0.5, -0.2, 0.7}};
  const Eigen::Vector3d landmark(3.0, 1.0, 6.0);
  for (const int64_t reference : {1, 3}) {
    const Rigid3 before = (*removed.Find(map, {reference}) * reference_from_camera).Pose();
    const Eigen::Vector3d seen_before = before.Inverse() * landmark;
    Map corrected = map;
    RemovedKeyframes links = removed;
    if (reference == 1) Remove(corrected, {{1}}, links);
    Correct(corrected, kCorrection);
    Correct(corrected, kCorrection);
    const Rigid3 after = (*links.Find(corrected, {reference}) * reference_from_camera).Pose();
    const Eigen::Vector3d seen_after = after.Inverse() * (kCorrection * (kCorrection * landmark));
    EXPECT_LT((seen_after - kCorrection.scale * kCorrection.scale * seen_before).norm(), 1e-9) << reference;
  }
}

}  // namespace
}  // namespace tessera
