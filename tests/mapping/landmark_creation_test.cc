// Which keypoints become landmarks, and where these are.
#include "mapping/landmark_creation.h"

#include <gtest/gtest.h>

#include <vector>

#include "map/map_editor.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Keyframes in which only every third point has a landmark; the other keypoints are free.
class PartlyKnownMap {
 public:
  PartlyKnownMap(SensorType sensor, const std::vector<int64_t>& steps) : world_(sensor), planted_(world_) {
    for (size_t i = 0; i < steps.size(); ++i) planted_.Add(steps[i], {static_cast<int64_t>(i) - 1});
    std::vector<LandmarkId> unknown;
    map().landmarks().ForEach([&](LandmarkId id, const Landmark&) {
      if (PointOf(id) % 3 != 0) unknown.push_back(id);
    });
    MapEditor editor(planted_.map());
    for (const LandmarkId id : unknown) editor.RemoveLandmark(id);
    (void)editor.Finish(map().answered());
  }

  const Map& map() const { return planted_.map(); }
  int NumMixed() const { return planted_.NumMixed(map()); }
  size_t PointOf(LandmarkId id) const { return planted_.PointOf(map().ObservationsOf(id).front()); }
  Eigen::Vector3d Truth(LandmarkId id) const { return world_.point(PointOf(id)); }

  template <class Create>
  std::vector<LandmarkId> Run(const Create& create, const CreationOptions& options = {}) {
    MapEditor editor(planted_.map());
    const std::vector<LandmarkId> created = create(KeyframeId{map().keyframes().end_id() - 1}, options, editor);
    (void)editor.Finish(map().answered());
    return created;
  }

 private:
  SyntheticWorld world_;
  PlantedMap planted_;
};

TEST(CreateFromPairs, TwoViewsOfAFreePointBecomeALandmarkWhereThePointIs) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  const std::vector<LandmarkId> created = world.Run(CreateFromPairs);
  EXPECT_GT(created.size(), 50U);
  EXPECT_EQ(world.NumMixed(), 0) << "both keypoints show the same point";
  for (const LandmarkId id : created) {
    ASSERT_EQ(world.map().ObservationsOf(id).size(), 2U);
    EXPECT_NE(world.PointOf(id) % 3, 0U) << "that point has a landmark already";
    EXPECT_THAT(world.map().FindLandmark(id)->position_in_world, IsNear(world.Truth(id), 0.02));
  }
}

TEST(CreateFromPairs, APairNeedsParallax) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  EXPECT_TRUE(world.Run(CreateFromPairs, {.min_parallax_rad = 0.8}).empty());
}

TEST(CreateFromPairs, KeyframesAtTheSamePositionAreNotSearched) {
  PartlyKnownMap world(SensorType::kMono, {3, 3});
  EXPECT_TRUE(world.Run(CreateFromPairs).empty());
}

TEST(CreateFromPairs, OnlyTheBestNeighborsAreSearched) {
  PartlyKnownMap all(SensorType::kMono, {0, 2, 4}), one(SensorType::kMono, {0, 2, 4});
  const std::vector<LandmarkId> from_one = one.Run(CreateFromPairs, {.max_neighbors = 1});
  EXPECT_GT(all.Run(CreateFromPairs).size(), from_one.size());
  for (const LandmarkId id : from_one) EXPECT_EQ(one.map().ObservationsOf(id).front().keyframe, KeyframeId{1});
}

// Descriptors of one point differ by about 20 bits in this world.
TEST(CreateFromPairs, DescriptorsMustBeAlike) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  EXPECT_TRUE(world.Run(CreateFromPairs, {.max_hamming = 1}).empty());
}

TEST(CreateFromDepth, AKeypointWithDepthBecomesALandmarkWhereThePointIs) {
  PartlyKnownMap world(SensorType::kStereo, {0});
  const std::vector<LandmarkId> created = world.Run(CreateFromDepth);
  EXPECT_GT(created.size(), 100U);
  for (const LandmarkId id : created) {
    EXPECT_NE(world.PointOf(id) % 3, 0U) << "that point has a landmark already";
    EXPECT_THAT(world.map().FindLandmark(id)->position_in_world, IsNear(world.Truth(id), 0.02));
  }
}

// Beyond max_depth_baselines a depth is too uncertain, but the nearest min_depth_points are used at any depth.
TEST(CreateFromDepth, FarKeypointsCountOnlyWhereNearOnesAreFew) {
  const auto count_beyond = [](const PartlyKnownMap& world, const std::vector<LandmarkId>& created, double depth_m) {
    int num_beyond = 0;
    for (const LandmarkId id : created) num_beyond += world.Truth(id).z() > depth_m + 0.01 ? 1 : 0;
    return num_beyond;
  };
  PartlyKnownMap rich(SensorType::kStereo, {0}), poor(SensorType::kStereo, {0});
  const auto near_only = rich.Run(CreateFromDepth, {.max_depth_baselines = 24.0, .min_depth_points = 1});
  EXPECT_GT(near_only.size(), 10U);
  EXPECT_EQ(count_beyond(rich, near_only, 24.0 * 0.5), 0);
  const auto with_far = poor.Run(CreateFromDepth, {.max_depth_baselines = 0.1, .min_depth_points = 100});
  EXPECT_GT(with_far.size(), 50U) << "those of the 100 nearest that have no landmark yet";
  EXPECT_LE(with_far.size(), 100U);
}

TEST(CreateFromDepth, MonoKeypointsHaveNone) {
  PartlyKnownMap world(SensorType::kMono, {0});
  EXPECT_TRUE(world.Run(CreateFromDepth).empty());
}

TEST(CreationOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(CreationOptions{}.Check(), IsSuccess());
  EXPECT_THAT(CreationOptions{.max_neighbors = 0}.Check(), IsFailure(HasSubstr("neighbor")));
  EXPECT_THAT(CreationOptions{.min_parallax_rad = 0.0}.Check(), IsFailure(HasSubstr("parallax")));
  EXPECT_THAT(CreationOptions{.max_hamming = 257}.Check(), IsFailure(HasSubstr("256")));
}

}  // namespace
}  // namespace tessera
