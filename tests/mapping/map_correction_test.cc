#include "mapping/map_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "map/spanning_tree.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

const Sim3 kAway{1.6, ExpSO3({0.1, -0.4, 0.2}), {7.0, 1.0, -3.0}};

void ExpectNear(const Sim3& a, const Sim3& b) {
  EXPECT_NEAR(a.scale, b.scale, 1e-12 * b.scale);
  EXPECT_LT((a.translation - b.translation).norm(), 1e-9);
  EXPECT_LT(a.rotation.angularDistance(b.rotation), 1e-7);
}

// Edits the map, and checks that a replica follows the delta.
template <class Edit>
void EditBoth(Map& map, Edit edit) {
  Map replica = map;
  MapEditor editor(map);
  edit(editor);
  EXPECT_THAT(replica.Apply(editor.Finish(map.answered())), IsSuccess());
  EXPECT_EQ(replica.Sha256Hex(), map.Sha256Hex());
}

TEST(MapCorrection, KeyframesMoveByTheirCorrectionOrTheirParents) {
  SyntheticWorld world(SensorType::kMono, 0.0);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 6; ++k) planted.Add(k, {k - 1});
  const Map before = planted.map();
  const Sim3 other{0.7, ExpSO3({0.0, 0.2, 0.0}), {0.0, 0.0, 1.0}};
  EditBoth(planted.map(), [&](MapEditor& editor) {
    ApplyCorrections({{{1}, kAway}, {{3}, other}, {{77}, kAway}}, editor);  // 77 is gone
  });
  const std::vector<Sim3> moves{{}, kAway, kAway, other, other, other};
  for (int64_t k = 0; k < 6; ++k) {
    ExpectNear(planted.map().FindKeyframe({k})->WorldFromKeyframe(),
               moves[static_cast<size_t>(k)] * before.FindKeyframe({k})->WorldFromKeyframe());
  }
  planted.map().landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const auto oldest = static_cast<size_t>(before.ObservationsOf(id).front().keyframe.value);
    const Landmark& old = *before.FindLandmark(id);
    EXPECT_LT((landmark.position_in_world - moves[oldest] * old.position_in_world).norm(), 1e-9);
    EXPECT_LT((landmark.normal - moves[oldest].rotation * old.normal).norm(), 1e-9);
    EXPECT_NEAR(landmark.min_distance, moves[oldest].scale * old.min_distance, 1e-9);
    EXPECT_NEAR(landmark.max_distance, moves[oldest].scale * old.max_distance, 1e-9);
  });
}

// From keyframe 3 on, the map is too small by a factor of 4, but for what came after keyframe 4: by 2.
TEST(MapCorrection, MendsAScaleThatHasSlipped) {
  SyntheticWorld world(SensorType::kMono, 0.0);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 7; ++k) planted.Add(k, {k - 1});
  const KeyframeId elsewhere = planted.Add(20, {});
  const Map before = planted.map();
  const std::vector<double> factors{1.0, 1.0, 1.0, 4.0, 4.0, 2.0, 2.0};
  EditBoth(planted.map(), [&](MapEditor& editor) {
    const std::vector<ScaleMending> mendings{{{3}, std::log(4.0)}, {{5}, std::log(2.0)}};
    ApplyCorrections(ScaleCorrections(editor.map(), {6}, mendings), editor);
  });
  for (int64_t k = 0; k < 7; ++k) {
    const Keyframe& keyframe = *planted.map().FindKeyframe({k});
    EXPECT_NEAR(keyframe.scale, factors[static_cast<size_t>(k)] * before.FindKeyframe({k})->scale, 1e-12);
    if (k == 0) continue;
    const Rigid3 way = planted.map().FindKeyframe({k - 1})->world_from_camera.Inverse() * keyframe.world_from_camera;
    Rigid3 expected = planted.Between({k - 1}, {k});
    expected.translation *= factors[static_cast<size_t>(k - 1)];
    EXPECT_THAT(way, IsNear(expected, 1e-9)) << k;
  }
  ExpectNear(planted.map().FindKeyframe(elsewhere)->WorldFromKeyframe(),
             before.FindKeyframe(elsewhere)->WorldFromKeyframe());
}

TEST(MapCorrection, AWholePartIsMendedAroundItsFirstKeyframe) {
  SyntheticWorld world(SensorType::kMono, 0.0);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k - 1});
  const Corrections corrections = ScaleCorrections(planted.map(), {3}, {{{0}, std::log(3.0)}});
  ASSERT_EQ(corrections.size(), 4U);
  const Sim3 first = planted.map().FindKeyframe({0})->WorldFromKeyframe();
  const Sim3 grown = first * Sim3::From({}, 3.0) * first.Inverse();
  for (const auto& [id, new_world_from_old] : corrections) ExpectNear(new_world_from_old, grown);
}

// Two visits of one place, as two parts of the map; the second stands elsewhere, in another unit.
class TwoVisits {
 public:
  TwoVisits(SyntheticWorld& world, const Sim3& second_from_truth) : planted_(world) {
    for (int64_t k = 0; k < 4; ++k) planted_.Add(k, {k - 1}, 0);
    for (int64_t k = 4; k < 8; ++k)
      planted_.Add(k - 4, k == 4 ? KeyframeId{} : KeyframeId{k - 1}, 1, second_from_truth);
    // Keyframe 7 came back to where keyframe 3 was, and the second part moves onto the first.
    loop_.answers = {7};
    loop_.matched = {3};
    loop_.matched_from_current = Sim3::From(planted_.Between({3}, {7}), 1.0 / second_from_truth.scale);
    loop_.joins_parts = true;
    const Map& map = planted_.map();
    for (int64_t k = 4; k < 8; ++k) loop_.corrections.push_back({{k}, second_from_truth.Inverse()});
    std::map<size_t, LandmarkId> first_names;  // by point
    const Keyframe& matched = *map.FindKeyframe({3});
    for (size_t i = 0; i < matched.landmarks.size(); ++i) {
      first_names[planted_.PointOf({{3}, static_cast<int32_t>(i)})] = matched.landmarks[i];
    }
    const size_t num_keypoints = map.FindKeyframe({7})->landmarks.size();
    for (size_t i = 0; i < num_keypoints; ++i) {
      const auto keypoint = static_cast<int32_t>(i);
      const auto first = first_names.find(planted_.PointOf({{7}, keypoint}));
      if (first != first_names.end()) loop_.seen.push_back({keypoint, first->second});
    }
  }

  PlantedMap& planted() { return planted_; }
  LoopResult& loop() { return loop_; }

 private:
  PlantedMap planted_;
  LoopResult loop_;
};

TEST(MapCorrection, ClosingALoopMakesTwoPlacesOne) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticWorld world(sensor, 0.2);
    const Sim3 away{sensor == SensorType::kMono ? kAway.scale : 1.0, kAway.rotation, kAway.translation};
    TwoVisits visits(world, away);
    Map& map = visits.planted().map();
    const int64_t num_before = map.landmarks().size();
    EditBoth(map, [&](MapEditor& editor) { CloseLoop(visits.loop(), {}, editor); });
    EXPECT_LT(map.landmarks().size(), num_before * 6 / 10) << "most points had two names";
    EXPECT_EQ(visits.planted().NumMixed(map), 0) << "no landmark is two points";
    EXPECT_LT(visits.planted().WorstKeyframe(map), 1e-9) << "both parts stand on the truth";
    EXPECT_LT(visits.planted().MedianLandmark(map), 1e-9);
    for (int64_t k = 0; k < 8; ++k) {
      EXPECT_EQ(RootOf(map, {k}), KeyframeId{0});
      EXPECT_NEAR(map.FindKeyframe({k})->scale, k < 4 ? 1.0 : 1.0 / away.scale, 1e-12);
    }
    EXPECT_EQ(map.FindKeyframe({7})->parent, KeyframeId{3});
    EXPECT_GT(map.NumShared({3}, {7}), static_cast<int>(visits.loop().seen.size()) * 9 / 10);
    ASSERT_EQ(map.closed_loops().size(), 1U);
    EXPECT_EQ(map.closed_loops()[0].current, KeyframeId{7});
    EXPECT_EQ(map.closed_loops()[0].matched, KeyframeId{3});
    EXPECT_EQ(map.closed_loops()[0].num_points, static_cast<int32_t>(visits.loop().seen.size()));
  }
}

// The older place may belong to the part that moves, far and turned round: its landmarks are found all the same.
TEST(MapCorrection, ThePlaceThatMovesIsFusedToo) {
  SyntheticWorld world(SensorType::kMono, 0.2);
  PlantedMap planted(world);
  const Sim3 away{2.5, ExpSO3({0.0, 2.8, 0.0}), {7.0, 1.0, -3.0}};
  planted.Add(9, {}, 0);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, k == 0 ? KeyframeId{} : KeyframeId{k}, 1, away);  // keyframes 1 .. 4
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k == 0 ? 0 : 4 + k}, 0);                         // 5 .. 8
  LoopResult loop;
  loop.answers = {8};
  loop.matched = {4};
  const Rigid3 truth = planted.Between({4}, {8});
  loop.matched_from_current = {away.scale, truth.rotation, away.scale * truth.translation};
  for (int64_t k = 1; k < 5; ++k) loop.corrections.push_back({{k}, away.Inverse()});
  Map& map = planted.map();
  const int64_t num_before = map.landmarks().size();
  EditBoth(map, [&](MapEditor& editor) { CloseLoop(loop, {}, editor); });
  EXPECT_LT(map.landmarks().size(), num_before * 7 / 10);
  EXPECT_EQ(planted.NumMixed(map), 0);
  EXPECT_EQ(RootOf(map, {1}), KeyframeId{0});
}

// What happened since the loop was found does no harm: landmarks that are gone, a new keyframe, one that was culled.
TEST(MapCorrection, AMapThatGrewSinceIsCorrectedAsAWhole) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  const Sim3 away{1.0, kAway.rotation, kAway.translation};
  TwoVisits visits(world, away);
  Map& map = visits.planted().map();
  visits.planted().Add(4, {7}, 1, away);
  EditBoth(map, [&](MapEditor& editor) {
    editor.RemoveLandmark(visits.loop().seen[0].landmark);
    editor.RemoveLandmark(map.FindKeyframe({7})->landmarks[static_cast<size_t>(visits.loop().seen[1].keypoint)]);
    editor.SetParent({6}, {4});
    editor.RemoveKeyframe({5});
  });
  EditBoth(map, [&](MapEditor& editor) { CloseLoop(visits.loop(), {}, editor); });
  EXPECT_LT(visits.planted().WorstKeyframe(map), 1e-9);
  EXPECT_LT(visits.planted().MedianLandmark(map), 1e-9);
  EXPECT_EQ(visits.planted().NumMixed(map), 0);
  EXPECT_EQ(RootOf(map, {8}), KeyframeId{0});
}

// The older part may be the one that moves: the newer keyframe's tree is the older one's.
TEST(MapCorrection, TheTreeThatBeganLaterHangsBelowTheOther) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  TwoVisits visits(world, Sim3{1.0, kAway.rotation, kAway.translation});
  Map& map = visits.planted().map();
  EditBoth(map, [&](MapEditor& editor) {  // keyframe 7 belongs to the first part, keyframe 3 to the second
    editor.SetParent({7}, {2});
    editor.SetParent({5}, {});
    editor.SetParent({4}, {5});
    editor.SetParent({3}, {6});
  });
  LoopResult loop = visits.loop();
  loop.corrections.clear();
  EditBoth(map, [&](MapEditor& editor) { CloseLoop(loop, {}, editor); });
  EXPECT_EQ(map.FindKeyframe({3})->parent, KeyframeId{7});
  EXPECT_EQ(map.FindKeyframe({6})->parent, KeyframeId{3});
  for (int64_t k = 0; k < 8; ++k) EXPECT_EQ(RootOf(map, {k}), KeyframeId{0}) << k;
}

TEST(MapCorrection, AnAdjustmentIsAppliedToWhatBecameOfTheMap) {
  SyntheticWorld world(SensorType::kStereo, 0.2);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 4; ++k) planted.Add(k, {k - 1});
  const AdjustmentBase base = TakeBase(planted.map());
  const auto shift = [](int64_t k) {
    return Rigid3{ExpSO3({0.0, 0.01 * static_cast<double>(k), 0.0}), {0.0, 0.1, 0.0}};
  };
  GlobalAdjustment adjustment;
  adjustment.answers = {3};
  adjustment.is_usable = true;
  for (int64_t k = 1; k < 4; ++k) {
    adjustment.poses.push_back({{k}, shift(k) * planted.map().FindKeyframe({k})->world_from_camera});
  }
  const Eigen::Vector3d lift(0.0, -0.5, 0.0);
  base.positions_in_world.ForEach(
      [&](LandmarkId id, const Eigen::Vector3d& position) { adjustment.points.push_back({id, position + lift}); });
  // Meanwhile: keyframe 4 came, keyframe 2 and a landmark moved, another landmark went.
  planted.Add(4, {3});
  const LandmarkId moved = planted.map().FindKeyframe({2})->landmarks[0];
  const LandmarkId gone = planted.map().FindKeyframe({2})->landmarks[1];
  const Rigid3 local{ExpSO3({0.02, 0.0, 0.0}), {0.3, 0.0, 0.0}};
  EditBoth(planted.map(), [&](MapEditor& editor) {
    editor.MoveKeyframe({2}, local * planted.map().FindKeyframe({2})->world_from_camera);
    Landmark landmark = *planted.map().FindLandmark(moved);
    landmark.position_in_world.x() += 0.25;
    editor.ChangeLandmark(moved, landmark);
    editor.RemoveLandmark(gone);
  });
  const Map before = planted.map();
  EditBoth(planted.map(), [&](MapEditor& editor) { ApplyAdjustment(adjustment, base, editor); });
  for (int64_t k = 0; k < 5; ++k) {
    const Sim3 correction = k == 0 ? Sim3{} : Sim3::From(shift(std::min<int64_t>(k, 3)));
    ExpectNear(planted.map().FindKeyframe({k})->WorldFromKeyframe(),
               correction * before.FindKeyframe({k})->WorldFromKeyframe());
  }
  planted.map().landmarks().ForEach([&](LandmarkId id, const Landmark& landmark) {
    const Eigen::Vector3d* in_base = base.positions_in_world.Find(id);
    if (in_base != nullptr && id != moved) {
      EXPECT_EQ(landmark.position_in_world, Eigen::Vector3d(*in_base + lift)) << id.value;
      return;
    }
    const int64_t oldest = before.ObservationsOf(id).front().keyframe.value;
    const Sim3 correction = oldest == 0 ? Sim3{} : Sim3::From(shift(std::min<int64_t>(oldest, 3)));
    EXPECT_LT((landmark.position_in_world - correction * before.FindLandmark(id)->position_in_world).norm(), 1e-9);
  });
  EXPECT_EQ(planted.map().FindLandmark(gone), nullptr);
}

}  // namespace
}  // namespace tessera
