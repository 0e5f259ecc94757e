// Landmarks that prove unreliable soon after their creation leave the map.
#include "mapping/landmark_culling.h"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "map/map_editor.h"
#include "measurement/landmark_description.h"
#include "support/map_changes.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Keyframes 0 .. 9, and one landmark that keyframes 0 and 1 observe.
class RecentLandmark : public testing::Test {
 protected:
  RecentLandmark() : editor_(map_) {
    for (int64_t k = 0; k < 10; ++k) editor_.AddKeyframe({k}, {k - 1}, {}, PlainFeatures(k, 5));
    landmark_ = editor_.AddLandmark({});
    Observe(0);
    Observe(1);
    recent_.Add({1}, {landmark_});
  }

  void Observe(int64_t keyframe) { editor_.AddObservation(landmark_, {{keyframe}, 0}); }
  bool SurvivesUntil(int64_t keyframe) {
    recent_.Cull({keyframe}, {.recent_keyframes = 3, .min_observations = 3}, editor_);
    return map_.FindLandmark(landmark_) != nullptr;
  }

  Map map_;
  MapEditor editor_;
  RecentLandmarks recent_;
  LandmarkId landmark_;
};

TEST_F(RecentLandmark, IsRemovedIfTheNextTwoKeyframesDoNotObserveIt) {
  EXPECT_TRUE(SurvivesUntil(1));
  EXPECT_TRUE(SurvivesUntil(2)) << "it may be observed by the next";
  EXPECT_FALSE(SurvivesUntil(3));
}

TEST_F(RecentLandmark, StaysWithAThirdObservation) {
  EXPECT_TRUE(SurvivesUntil(2));
  Observe(3);
  EXPECT_TRUE(SurvivesUntil(3));
  EXPECT_TRUE(SurvivesUntil(4));
}

TEST_F(RecentLandmark, IsTestedAgainWhileItIsRecent) {
  Observe(2);
  EXPECT_TRUE(SurvivesUntil(3));
  editor_.RemoveObservation(landmark_, {{2}, 0});
  EXPECT_FALSE(SurvivesUntil(4));
}

TEST_F(RecentLandmark, IsTrustedForGoodOnceItIsOld) {
  Observe(2);
  EXPECT_TRUE(SurvivesUntil(4));
  editor_.RemoveObservation(landmark_, {{2}, 0});
  EXPECT_TRUE(SurvivesUntil(5));
}

TEST_F(RecentLandmark, MayLeaveTheMapForAnotherReason) {
  editor_.RemoveLandmark(landmark_);
  EXPECT_FALSE(SurvivesUntil(3));
}

// Eight keyframes in a row. Where a landmark should be seen follows from its position; whether it is, from its
// observations.
class Confirmation : public testing::Test {
 protected:
  Confirmation() {
    for (int64_t k = 0; k < 8; ++k) planted_.Add(k, {k - 1});
  }

  // A landmark in front of all keyframes that the last `num_observers` of them observe.
  LandmarkId AddChance(int num_observers, MapEditor& editor) {
    const LandmarkId id = editor.AddLandmark({.position_in_world = {0.0, 0.0, 12.0}});
    for (int64_t k = 7; k > 7 - num_observers; --k) {
      const Keyframe& keyframe = *editor.map().FindKeyframe({k});
      const int32_t keypoint = TakeKeypoint(keyframe);
      editor.RemoveObservation(keyframe.landmarks[static_cast<size_t>(keypoint)], {{k}, keypoint});
      editor.AddObservation(id, {{k}, keypoint});
    }
    editor.ChangeLandmark(id, DescribeLandmark(editor.map(), id));
    return id;
  }

  // One that was not taken before, on a middle level: the landmark is then expected at all distances of this world.
  int32_t TakeKeypoint(const Keyframe& keyframe) {
    for (int32_t i = 0; i < static_cast<int32_t>(keyframe.landmarks.size()); ++i) {
      const bool is_middle = keyframe.features->keypoints[static_cast<size_t>(i)].level == 4;
      if (is_middle && taken_.insert({keyframe.features->frame.value, i}).second) return i;
    }
    throw std::logic_error("no keypoint is left");
  }

  SyntheticWorld world_{SensorType::kMono};
  PlantedMap planted_{world_};
  std::set<std::pair<int64_t, int32_t>> taken_;
};

TEST_F(Confirmation, RemovesWhatTooFewOfTheExpectedKeyframesObserve) {
  MapEditor editor(planted_.map());
  const LandmarkId chance = AddChance(2, editor), seen = AddChance(5, editor);
  RemoveUnconfirmed({7}, {chance, seen}, {.min_seen_share = 0.5}, editor);
  EXPECT_EQ(editor.map().FindLandmark(chance), nullptr) << "two of about eight";
  EXPECT_NE(editor.map().FindLandmark(seen), nullptr) << "five of about eight";
}

TEST_F(Confirmation, ThePairThatMadeItDoesNotCount) {
  MapEditor editor(planted_.map());
  const LandmarkId by_one = AddChance(3, editor), by_two = AddChance(4, editor);
  RemoveUnconfirmed({7}, {by_one, by_two}, {.min_seen_share = 0.3}, editor);
  EXPECT_EQ(editor.map().FindLandmark(by_one), nullptr) << "one of six others, though three of eight";
  EXPECT_NE(editor.map().FindLandmark(by_two), nullptr) << "two of six others";
}

TEST_F(Confirmation, AsksOnlyForLandmarksJustCreated) {
  MapEditor editor(planted_.map());
  const LandmarkId chance = AddChance(2, editor);
  RemoveUnconfirmed({7}, {}, {.min_seen_share = 0.5}, editor);
  EXPECT_NE(editor.map().FindLandmark(chance), nullptr);
}

TEST_F(Confirmation, KeyframesThatCannotSeeItDoNotCount) {
  MapEditor editor(planted_.map());
  const LandmarkId chance = AddChance(2, editor);
  Landmark behind = *editor.map().FindLandmark(chance);
  behind.position_in_world.z() = -5.0;
  editor.ChangeLandmark(chance, behind);
  RemoveUnconfirmed({7}, {chance}, {.min_seen_share = 0.5}, editor);
  EXPECT_NE(editor.map().FindLandmark(chance), nullptr);
}

TEST(LandmarkCullingOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(LandmarkCullingOptions{}.Check(), IsSuccess());
  EXPECT_THAT(LandmarkCullingOptions{.recent_keyframes = 0}.Check(), IsFailure(HasSubstr("recent")));
  EXPECT_THAT(LandmarkCullingOptions{.num_checked_views = 0}.Check(), IsFailure(HasSubstr("checked")));
}

}  // namespace
}  // namespace tessera
