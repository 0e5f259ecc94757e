// Landmarks of one and the same point become one; all others stay apart.
#include "mapping/landmark_fusion.h"

#include <gtest/gtest.h>

#include <vector>

#include "map/map_editor.h"
#include "measurement/landmark_description.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr KeyframeId kNewest{4};

// Five keyframes; the newest shares most of its landmarks with the others.
class LandmarkFusion : public testing::Test {
 protected:
  LandmarkFusion() {
    for (int64_t k = 0; k <= kNewest.value; ++k) planted_.Add(k, {k - 1});
  }

  template <class Edit>
  void Change(const Edit& edit) {
    MapEditor editor(planted_.map());
    edit(editor);
    (void)editor.Finish(kNewest);
  }
  void Fuse(const FusionOptions& options = {}) {
    Change([&](MapEditor& editor) { FuseLandmarks(kNewest, options, editor); });
  }

  // Landmarks of the newest keyframe with at least two older observers: every third of them.
  std::vector<Observation> Chosen(std::vector<LandmarkId>* landmarks) const {
    std::vector<Observation> chosen;
    const Keyframe& newest = *map().FindKeyframe(kNewest);
    for (size_t i = 0; i < newest.landmarks.size(); i += 3) {
      const LandmarkId id = newest.landmarks[i];
      if (!id.valid() || map().ObservationsOf(id).size() < 3) continue;
      chosen.push_back({kNewest, static_cast<int32_t>(i)});
      landmarks->push_back(id);
    }
    return chosen;
  }
  // The newest keyframe observes the chosen points under new names; the old ones lose this observation.
  std::vector<LandmarkId> Duplicate(const std::vector<LandmarkId>& landmarks, const std::vector<Observation>& at) {
    std::vector<LandmarkId> duplicates;
    Change([&](MapEditor& editor) {
      for (size_t i = 0; i < landmarks.size(); ++i) {
        editor.RemoveObservation(landmarks[i], at[i]);
        duplicates.push_back(editor.AddLandmark(*map().FindLandmark(landmarks[i])));
        editor.AddObservation(duplicates.back(), at[i]);
      }
    });
    return duplicates;
  }
  const Map& map() const { return planted_.map(); }

  SyntheticWorld world_{SensorType::kStereo};
  PlantedMap planted_{world_};
};

TEST_F(LandmarkFusion, DuplicatesAreMergedIntoTheLandmarkWithMoreObservations) {
  std::vector<LandmarkId> landmarks;
  const std::vector<Observation> at = Chosen(&landmarks);
  ASSERT_GT(at.size(), 20U);
  const std::vector<LandmarkId> duplicates = Duplicate(landmarks, at);
  Fuse();
  for (size_t i = 0; i < at.size(); ++i) {
    EXPECT_EQ(map().FindLandmark(duplicates[i]), nullptr) << i;
    EXPECT_TRUE(map().IsSeenBy(landmarks[i], kNewest)) << i;
  }
  EXPECT_EQ(planted_.NumMixed(map()), 0);
}

TEST_F(LandmarkFusion, OfTwoWithEquallyManyObservationsTheOlderStays) {
  const auto newest = static_cast<size_t>(kNewest.value);
  std::vector<LandmarkId> landmarks;
  const std::vector<Observation> at = Chosen(&landmarks);
  const LandmarkId younger = Duplicate({landmarks[0]}, {at[0]})[0];
  Change([&](MapEditor& editor) {  // the old one keeps a single observation
    while (map().ObservationsOf(landmarks[0]).size() > 1) {
      editor.RemoveObservation(landmarks[0], map().ObservationsOf(landmarks[0]).back());
    }
  });
  ASSERT_EQ(map().ObservationsOf(landmarks[0]).size(), map().ObservationsOf(younger).size());
  Fuse();
  EXPECT_EQ(map().FindLandmark(younger), nullptr);
  EXPECT_GE(map().ObservationsOf(landmarks[0]).size(), newest - 2);
}

TEST_F(LandmarkFusion, MissingObservationsAreAddedInBothDirections) {
  std::vector<LandmarkId> landmarks;
  const std::vector<Observation> at = Chosen(&landmarks);
  const std::span<const Observation> observations = map().ObservationsOf(landmarks[1]);
  const Observation in_older = observations[observations.size() - 2];
  Change([&](MapEditor& editor) {
    editor.RemoveObservation(landmarks[0], at[0]);
    editor.RemoveObservation(landmarks[1], in_older);
  });
  Fuse();
  EXPECT_EQ(map().FindKeyframe(kNewest)->landmarks[static_cast<size_t>(at[0].keypoint)], landmarks[0]);
  EXPECT_TRUE(map().IsSeenBy(landmarks[1], in_older.keyframe));
}

TEST_F(LandmarkFusion, AProjectionBesideTheKeypointIsNoMatch) {
  std::vector<LandmarkId> landmarks;
  const std::vector<Observation> at = Chosen(&landmarks);
  Change([&](MapEditor& editor) {
    editor.RemoveObservation(landmarks[0], at[0]);
    Landmark landmark = *map().FindLandmark(landmarks[0]);
    landmark.position_in_world.y() += 0.5;
    editor.ChangeLandmark(landmarks[0], landmark);
  });
  Fuse();
  EXPECT_FALSE(map().IsSeenBy(landmarks[0], kNewest));
}

TEST_F(LandmarkFusion, AnotherDescriptorIsNoMatch) {
  std::vector<LandmarkId> landmarks;
  const std::vector<Observation> at = Chosen(&landmarks);
  Change([&](MapEditor& editor) {
    editor.RemoveObservation(landmarks[0], at[0]);
    Landmark landmark = *map().FindLandmark(landmarks[0]);
    for (uint64_t& word : landmark.descriptor) word = ~word;
    editor.ChangeLandmark(landmarks[0], landmark);
  });
  Fuse();
  EXPECT_FALSE(map().IsSeenBy(landmarks[0], kNewest));
}

// Two visits that share no landmark: no neighbors, so the loop's fusion names the keyframes itself.
TEST(ProjectLandmarks, MakesTheLandmarksOfTwoVisitsOne) {
  SyntheticWorld world(SensorType::kStereo);
  PlantedMap planted(world);
  for (int64_t k = 0; k < 3; ++k) planted.Add(k, {k - 1}, 0);
  for (int64_t k = 3; k < 6; ++k) planted.Add(k - 3, k == 3 ? KeyframeId{} : KeyframeId{k - 1}, 1);
  const int64_t num_before = planted.map().landmarks().size();
  std::vector<LandmarkId> of_first;
  planted.map().landmarks().ForEach([&](LandmarkId id, const Landmark&) {
    if (planted.map().ObservationsOf(id).front().keyframe < KeyframeId{3}) of_first.push_back(id);
  });
  MapEditor editor(planted.map());
  ProjectLandmarks({{3}, {4}, {5}}, of_first, {}, editor);
  (void)editor.Finish({5});
  EXPECT_LT(planted.map().landmarks().size(), num_before * 6 / 10);
  EXPECT_EQ(planted.NumMixed(planted.map()), 0);
}

TEST(FusionOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(FusionOptions{}.Check(), IsSuccess());
  EXPECT_THAT(FusionOptions{.max_neighbors = 0}.Check(), IsFailure(HasSubstr("neighbor")));
  EXPECT_THAT(FusionOptions{.radius_px = 0.0}.Check(), IsFailure(HasSubstr("radius")));
}

}  // namespace
}  // namespace tessera
