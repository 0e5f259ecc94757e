// Which keyframes say nothing that others do not, and what their removal leaves behind.
#include "mapping/keyframe_culling.h"

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "map/map_editor.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Keyframes 0 .. 9 of a camera that hardly moves: every landmark has ten observers.
class KeyframeCulling : public testing::Test {
 protected:
  static constexpr int64_t kNum = 10;

  void Plant(const std::function<void(int64_t, FeatureFrame&)>& change = [](int64_t, FeatureFrame&) {}) {
    for (int64_t k = 0; k < kNum; ++k) {
      planted_.Add(0, {k - 1}, 0, {}, [&](FeatureFrame& features) { change(k, features); });
    }
  }
  void Cull(const KeyframeCullingOptions& options = {}) {
    MapEditor editor(planted_.map());
    KeyframeCuller(options).Cull({kNum - 1}, removed_, editor);
    (void)editor.Finish({kNum - 1});
  }
  std::vector<int64_t> Left() const {
    std::vector<int64_t> left;
    map().keyframes().ForEach([&](KeyframeId id, const Keyframe&) { left.push_back(id.value); });
    return left;
  }
  void ForEachObservation(const std::function<void(LandmarkId, const Observation&)>& visit) const {
    const Map before = map();
    before.landmarks().ForEach([&](LandmarkId id, const ObservedLandmark& landmark) {
      for (const Observation& seen : landmark.observations) visit(id, seen);
    });
  }
  // Takes observations from keyframes 0 .. 2.
  void ForgetInFirstVisit(const std::function<bool(LandmarkId)>& forgets) {
    MapEditor editor(planted_.map());
    ForEachObservation([&](LandmarkId landmark, const Observation& seen) {
      if (seen.keyframe.value < 3 && forgets(landmark)) editor.RemoveObservation(landmark, seen);
    });
    (void)editor.Finish({kNum - 1});
  }
  const Map& map() const { return planted_.map(); }

  SyntheticWorld world_{SensorType::kStereo};
  PlantedMap planted_{world_};
  RemovedKeyframes removed_;
};

TEST_F(KeyframeCulling, RedundantKeyframesGoButForTheRootAndTheNewest) {
  Plant();
  Cull({.kept_newest = 3});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 7, 8, 9}));
}

TEST_F(KeyframeCulling, AtTheEndTheNewestGoToo) {
  Plant();
  MapEditor editor(planted_.map());
  KeyframeCuller({.kept_newest = 3}).CullLast({kNum - 1}, removed_, editor);
  (void)editor.Finish({kNum - 1});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 8, 9})) << "each landmark keeps three observers";
}

// It remembers from call to call who observes what.
TEST_F(KeyframeCulling, ChangesSinceTheLastCallCount) {
  Plant();
  KeyframeCuller culler({});
  std::vector<std::pair<LandmarkId, Observation>> forgotten;
  ForEachObservation([&](LandmarkId landmark, const Observation& seen) {
    if (seen.keyframe.value >= 3) forgotten.emplace_back(landmark, seen);
  });
  MapEditor forgets(planted_.map());
  for (const auto& [landmark, seen] : forgotten) forgets.RemoveObservation(landmark, seen);
  culler.Cull({2}, removed_, forgets);
  (void)forgets.Finish({kNum - 1});
  EXPECT_EQ(Left().size(), 10U) << "three observers are not enough";
  MapEditor remembers(planted_.map());
  for (const auto& [landmark, seen] : forgotten) remembers.AddObservation(landmark, seen);
  culler.Cull({kNum - 1}, removed_, remembers);
  (void)remembers.Finish({kNum - 1});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 7, 8, 9})) << "as if it had not looked before";
}

TEST_F(KeyframeCulling, ALandmarkNeedsSeveralOtherObservers) {
  Plant();
  Cull({.redundant_observers = 8, .kept_newest = 1});
  EXPECT_EQ(Left().size(), 8U) << "of eight keyframes each has seven others";
}

// Most points of this world are seen on levels above 1.
TEST_F(KeyframeCulling, OnlyObserversOnAFineEnoughLevelCount) {
  Plant([](int64_t k, FeatureFrame& features) {
    if (k != 4) return;
    for (Keypoint& keypoint : features.keypoints) keypoint.level = 0;
  });
  Cull();
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 4, 7, 8, 9})) << "no other keyframe observes its landmarks as finely";
}

TEST_F(KeyframeCulling, KeyframesThatClosedALoopStay) {
  Plant();
  MapEditor editor(planted_.map());
  editor.AddClosedLoop({{5}, {2}, 1.0, 50});
  (void)editor.Finish({kNum - 1});
  Cull();
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 2, 5, 7, 8, 9}));
}

// Keyframes from `begin` on are another visit: their frames are counted anew.
std::function<void(int64_t, FeatureFrame&)> VisitsBeginningAt(int64_t begin) {
  return [begin](int64_t k, FeatureFrame& features) { features.frame = {k < begin ? k : k - begin}; };
}

// Twenty observers are nowhere: what is redundant is so because an earlier visit knows it.
TEST_F(KeyframeCulling, KeyframesOfAFurtherVisitGoWhereAnEarlierOneKnowsThePlace) {
  Plant(VisitsBeginningAt(5));
  Cull({.redundant_observers = 20});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 1, 2, 3, 4, 7, 8, 9}));
}

TEST_F(KeyframeCulling, KeyframesOfTheFirstVisitStayWhateverALaterOneSees) {
  Plant(VisitsBeginningAt(3));
  Cull({.redundant_observers = 4});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 1, 2, 7, 8, 9})) << "of 0 .. 2 each has two others in its visit";
}

TEST_F(KeyframeCulling, KeyframesOfAnUnknownPlaceStayInAFurtherVisit) {
  Plant(VisitsBeginningAt(3));
  ForgetInFirstVisit([](LandmarkId landmark) { return landmark.value % 3 != 0; });
  Cull({.redundant_observers = 20});
  EXPECT_EQ(Left().size(), 10U) << "a third of its landmarks is known";
  Cull({.redundant_observers = 20, .known_share = 0.25});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 1, 2, 7, 8, 9}));
}

// 0 and 1 see even landmarks, 2 and those from 7 on odd ones: what joins them is 3 .. 6.
TEST_F(KeyframeCulling, WhoAloneHoldsItsNeighborsTogetherStays) {
  Plant(VisitsBeginningAt(3));
  MapEditor editor(planted_.map());
  ForEachObservation([&](LandmarkId landmark, const Observation& seen) {
    const int64_t k = seen.keyframe.value;
    if ((k < 2 && landmark.value % 2 == 1) || ((k == 2 || k > 6) && landmark.value % 2 == 0))
      editor.RemoveObservation(landmark, seen);
  });
  (void)editor.Finish({kNum - 1});
  Cull({.redundant_observers = 20});
  EXPECT_EQ(Left(), (std::vector<int64_t>{0, 1, 2, 6, 7, 8, 9})) << "one of them is enough";
}

TEST_F(KeyframeCulling, ChildrenPassToTheParentAndTheRemovedAreRemembered) {
  Plant();
  const Sim3 before = map().FindKeyframe({4})->WorldFromKeyframe();
  Cull();
  EXPECT_EQ(map().FindKeyframe({7})->parent, KeyframeId{0});
  ASSERT_TRUE(removed_.Find(map(), {4}).has_value());
  EXPECT_THAT(*removed_.Find(map(), {4}), IsNear(before, 1e-9));
}

TEST(KeyframeCullingOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(KeyframeCullingOptions{}.Check(), IsSuccess());
  EXPECT_THAT(KeyframeCullingOptions{.redundant_share = 0.0}.Check(), IsFailure(HasSubstr("positive")));
  EXPECT_THAT(KeyframeCullingOptions{.known_share = 0.0}.Check(), IsFailure(HasSubstr("positive")));
  EXPECT_THAT(KeyframeCullingOptions{.min_tie = 0}.Check(), IsFailure(HasSubstr("positive")));
  EXPECT_THAT(KeyframeCullingOptions{.kept_newest = 0}.Check(), IsFailure(HasSubstr("positive")));
}

}  // namespace
}  // namespace tessera
