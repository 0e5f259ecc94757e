// Which keypoints become landmarks, and where these are.
#include "mapping/landmark_creation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "map/map_editor.h"
#include "measurement/keypoint_measurement.h"
#include "measurement/landmark_view.h"
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
  // Between the views of a landmark's two observers, and its noise, rad.
  double Parallax(LandmarkId id) const {
    const std::span<const Observation> seen = map().ObservationsOf(id);
    return std::acos(RayOf(seen[0]).dot(RayOf(seen[1])));
  }
  double ParallaxSigma(LandmarkId id) const {
    const std::span<const Observation> seen = map().ObservationsOf(id);
    return std::hypot(Seen(seen[0]).sigma_px, Seen(seen[1]).sigma_px) / world_.calibration().fx_px;
  }
  // By which the camera turned from the first keyframe to the last, rad.
  double Turn() const {
    return planted_.Truth({0}).rotation.angularDistance(planted_.Truth({map().keyframes().end_id() - 1}).rotation);
  }
  const Eigen::Vector3d& Position(LandmarkId id) const { return map().FindLandmark(id)->position_in_world; }
  // From the last keyframe to `other`, by the median depth.
  double BaselineShare(KeyframeId other) const {
    const std::vector<double> depths = LandmarkDepths(map(), *map().FindKeyframe({map().keyframes().end_id() - 1}));
    return (planted_.Truth(other).translation - Center()).norm() / depths[depths.size() / 2];
  }
  // Of the last keyframe, whose rays the landmarks stand on.
  Eigen::Vector3d Center() const {
    return map().FindKeyframe({map().keyframes().end_id() - 1})->world_from_camera.translation;
  }

  template <class Create>
  std::vector<LandmarkId> Run(const Create& create, const CreationOptions& options = {}) {
    MapEditor editor(planted_.map());
    const std::vector<LandmarkId> created = create(KeyframeId{map().keyframes().end_id() - 1}, options, editor);
    (void)editor.Finish(map().answered());
    return created;
  }

 private:
  PixelObservation Seen(const Observation& seen) const {
    return SeenAt(*map().FindKeyframe(seen.keyframe)->features, seen.keypoint);
  }
  Eigen::Vector3d RayOf(const Observation& seen) const {
    const Keyframe& keyframe = *map().FindKeyframe(seen.keyframe);
    return keyframe.world_from_camera.rotation * world_.calibration().Ray(Seen(seen).pixel_px).normalized();
  }

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

// Pairs without significant parallax become landmarks too, on their ray and somewhat too near: what is left of the
// distribution of the inverse depth above zero.
TEST(CreateFromPairs, APointWithoutParallaxStandsInItsDirection) {
  PartlyKnownMap known(SensorType::kMono, {0, 3}), far(SensorType::kMono, {0, 3});
  const size_t num_all = known.Run(CreateFromPairs, {.matching = {.min_parallax_per_turn = 0.0}}).size();
  const std::vector<LandmarkId> created =
      far.Run(CreateFromPairs, {.matching = {.min_parallax_sigmas = 1000.0, .min_parallax_per_turn = 0.0}});
  EXPECT_EQ(created.size(), num_all);
  for (const LandmarkId id : created) {
    const double sigmas = far.Parallax(id) / far.ParallaxSigma(id);
    const double nearer = 0.5 * (1.0 + std::sqrt(1.0 + 2.0 / (sigmas * sigmas)));
    const Eigen::Vector3d true_ray = far.Truth(id) - far.Center(), ray = far.Position(id) - far.Center();
    EXPECT_LT(true_ray.cross(ray).norm(), 1e-3 * true_ray.norm() * ray.norm());
    EXPECT_NEAR(true_ray.norm() / ray.norm(), nearer, 0.05 * nearer);
  }
}

TEST(CreateFromPairs, OnlyParallaxThatStandsOutOfTheNoiseIsTakenAtItsWord) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  int num_known = 0;
  for (const LandmarkId id :
       world.Run(CreateFromPairs, {.matching = {.min_parallax_sigmas = 12.0, .min_parallax_per_turn = 0.0}})) {
    const double error = (world.Position(id) - world.Truth(id)).norm();
    if (world.Parallax(id) > 12.0 * world.ParallaxSigma(id)) {
      EXPECT_LT(error, 0.02);
      ++num_known;
    }
  }
  EXPECT_GT(num_known, 10);
}

// What is systematically wrong in images grows with the way of a keypoint through them.
TEST(CreateFromPairs, ATurnBetweenTheViewsCountsAsNoise) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  const double limit = 2.0 * world.Turn();
  int num_known = 0, num_nearer = 0;
  for (const LandmarkId id : world.Run(CreateFromPairs, {.matching = {.min_parallax_per_turn = 2.0}})) {
    const double share = (world.Position(id) - world.Center()).norm() / (world.Truth(id) - world.Center()).norm();
    if (world.Parallax(id) >= limit) {
      EXPECT_NEAR(share, 1.0, 0.01);
      ++num_known;
    } else {
      EXPECT_LT(share, 0.97);
      ++num_nearer;
    }
  }
  EXPECT_GT(num_known, 10);
  EXPECT_GT(num_nearer, 10);
}

TEST(CreateFromPairs, KeyframesAtTheSamePositionAreNotSearched) {
  PartlyKnownMap world(SensorType::kMono, {3, 3});
  EXPECT_TRUE(world.Run(CreateFromPairs).empty());
}

// Where all that is seen is far, every neighbor is near.
TEST(CreateFromPairs, NeighborsTooNearToTellDepthsAreSearchedWhereLandmarksAreFew) {
  const auto num_created = [](double min_baseline_share, int few_landmarks) {
    PartlyKnownMap world(SensorType::kMono, {0, 3});
    const CreationOptions options{.min_baseline_share = min_baseline_share, .few_landmarks = few_landmarks};
    return world.Run(CreateFromPairs, options).size();
  };
  constexpr double kAllAreNear = 1e3;
  EXPECT_EQ(num_created(kAllAreNear, 0), 0U);
  EXPECT_EQ(num_created(kAllAreNear, 10000), num_created(0.01, 0));
}

TEST(CreateFromPairs, NeighborsThatTellDepthsComeFirst) {
  constexpr KeyframeId kFar{0}, kNear{1};
  const auto num_with = [](KeyframeId other, double min_baseline_share) {
    PartlyKnownMap world(SensorType::kMono, {0, 5, 6});
    const CreationOptions options{.min_baseline_share = min_baseline_share, .few_landmarks = 10000};
    const std::vector<LandmarkId> created = world.Run(CreateFromPairs, options);
    return std::ranges::count_if(created, [&](LandmarkId id) { return world.map().IsSeenBy(id, other); });
  };
  EXPECT_GT(num_with(kNear, 1e-3), num_with(kFar, 1e-3)) << "both tell; the near one shares more";
  const double between = 3.0 * PartlyKnownMap(SensorType::kMono, {0, 5, 6}).BaselineShare(kNear);
  EXPECT_GT(num_with(kFar, between), num_with(kFar, 1e-3));
  EXPECT_GT(num_with(kNear, between), 0) << "what only that one sees";
}

TEST(CreateFromPairs, OnlyTheBestNeighborsAreSearched) {
  PartlyKnownMap all(SensorType::kMono, {4, 9, 8}), one(SensorType::kMono, {4, 9, 8});
  const std::vector<LandmarkId> from_one = one.Run(CreateFromPairs, {.max_neighbors = 1});
  EXPECT_GT(all.Run(CreateFromPairs).size(), from_one.size());
  for (const LandmarkId id : from_one) EXPECT_EQ(one.map().ObservationsOf(id).front().keyframe, KeyframeId{1});
}

// Descriptors of one point differ by about 20 bits in this world.
TEST(CreateFromPairs, DescriptorsMustBeAlike) {
  PartlyKnownMap world(SensorType::kMono, {0, 3});
  EXPECT_TRUE(world.Run(CreateFromPairs, {.matching = {.max_hamming = 1}}).empty());
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

// Beyond max_baselines a depth is too uncertain, unless the keyframe sees few landmarks.
TEST(CreateFromDepth, FarKeypointsCountOnlyWhereNearOnesAreFew) {
  const auto count_beyond = [](const PartlyKnownMap& world, const std::vector<LandmarkId>& created, double depth_m) {
    int num_beyond = 0;
    for (const LandmarkId id : created) num_beyond += world.Truth(id).z() > depth_m + 0.01 ? 1 : 0;
    return num_beyond;
  };
  PartlyKnownMap rich(SensorType::kStereo, {0}), poor(SensorType::kStereo, {0});
  const auto near_only = rich.Run(CreateFromDepth, {.depth = {.max_baselines = 24.0, .min_points = 1}});
  EXPECT_GT(near_only.size(), 10U);
  EXPECT_EQ(count_beyond(rich, near_only, 24.0 * 0.5), 0);
  const auto num_seen = static_cast<int>(
      std::ranges::count_if(poor.map().FindKeyframe({0})->landmarks, [](LandmarkId id) { return id.valid(); }));
  const auto with_far = poor.Run(CreateFromDepth, {.depth = {.max_baselines = 0.1, .min_points = num_seen + 60}});
  ASSERT_EQ(with_far.size(), 60U);
  double farthest_m = 0.0;
  for (const LandmarkId id : with_far) farthest_m = std::max(farthest_m, poor.Truth(id).z());
  PartlyKnownMap all(SensorType::kStereo, {0});
  const auto of_all = all.Run(CreateFromDepth, {.depth = {.max_baselines = 1e6}});
  int num_nearer = 0;
  for (const LandmarkId id : of_all) num_nearer += all.Truth(id).z() < farthest_m - 0.01 ? 1 : 0;
  EXPECT_NEAR(num_nearer, 59, 3) << "the nearest first";
  EXPECT_TRUE(PartlyKnownMap(SensorType::kStereo, {0})
                  .Run(CreateFromDepth, {.depth = {.max_baselines = 0.1, .min_points = num_seen}})
                  .empty());
}

TEST(CreateFromDepth, MonoKeypointsHaveNone) {
  PartlyKnownMap world(SensorType::kMono, {0});
  EXPECT_TRUE(world.Run(CreateFromDepth).empty());
}

TEST(CreationOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(CreationOptions{}.Check(), IsSuccess());
  EXPECT_THAT(CreationOptions{.max_neighbors = 0}.Check(), IsFailure(HasSubstr("neighbor")));
  EXPECT_THAT(CreationOptions{.matching = {.min_parallax_sigmas = 0.0}}.Check(), IsFailure(HasSubstr("parallax")));
  EXPECT_THAT(CreationOptions{.matching = {.min_parallax_per_turn = -0.1}}.Check(), IsFailure(HasSubstr("parallax")));
  EXPECT_THAT(CreationOptions{.matching = {.min_parallax_per_turn = 0.0}}.Check(), IsSuccess());
  EXPECT_THAT(CreationOptions{.matching = {.max_hamming = 257}}.Check(), IsFailure(HasSubstr("256")));
}

}  // namespace
}  // namespace tessera
