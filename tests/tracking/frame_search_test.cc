// The search for a frame from the last one, on the synthetic world.
#include "tracking/frame_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// Replaces the descriptors of all but every n-th keypoint by others.
FeatureFrame Faded(FeatureFrame features, size_t n) {
  for (size_t i = 0; i < features.descriptors.size(); ++i) {
    if (i % n == 0) continue;
    for (uint64_t& word : features.descriptors[i]) word = ~word;
  }
  return features;
}

class FrameSearchTest : public testing::Test {
 protected:
  std::optional<FoundFrame> Follow(const FeatureFrame& features, const ExpectedFrame& expected) const {
    return FrameSearch(ViewOf(features), last_, expected, replica_, options_).Follow();
  }
  FeatureFrame Take() { return world_.Take(1, truth_).features; }

  SyntheticWorld world_{SensorType::kMono, 0.3};
  const TrackedFrame last_ = world_.TrackedAt(0);
  const Rigid3 truth_ = SyntheticWorld::Pose(1.0);
  const FrameSearchOptions options_;
  const MapReplica replica_;
};

TEST_F(FrameSearchTest, FindsAFrameWhereItIsExpected) {
  const auto found = Follow(Take(), {.world_from_camera = truth_});
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->frame.world_from_camera, IsNear(truth_, 0.02));
  EXPECT_FALSE(found->is_wide);
  EXPECT_FALSE(found->is_doubtful);
}

TEST_F(FrameSearchTest, SaysThatItIsFarFromWhereItIsExpected) {
  const Rigid3 turned = truth_ * Rigid3{ExpSO3({0.0, 0.3, 0.0}), Eigen::Vector3d::Zero()};
  const auto found = Follow(Take(), {.world_from_camera = turned});
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->frame.world_from_camera, IsNear(truth_, 0.02));
  EXPECT_TRUE(found->is_wide);
}

TEST_F(FrameSearchTest, DoubtsAFrameThatSeesFewOfTheLastPointsButDoesNotCallItWide) {
  const auto found = Follow(Faded(Take(), 6), {.world_from_camera = truth_});
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->frame.world_from_camera, IsNear(truth_, 0.05));
  EXPECT_FALSE(found->is_wide);
  EXPECT_TRUE(found->is_doubtful);
}

TEST_F(FrameSearchTest, BelievesASteadyMotionThatFewPointsAgreeWith) {
  const double sigma_m = 0.005;
  const PosePrior prior{truth_.Inverse(), Eigen::Matrix3d::Identity() / (sigma_m * sigma_m)};
  const auto found = Follow(Faded(Take(), 6), {.world_from_camera = truth_, .prior = prior});
  ASSERT_TRUE(found.has_value());
  EXPECT_FALSE(found->is_doubtful);
}

// Whose direction is known well, as that of a vehicle is.
TEST_F(FrameSearchTest, BelievesTheMotionOfAVehicleThatKnowsLess) {
  const double sigma_m = 0.005, turn_sigma_rad = 3.0 / world_.calibration().fx_px;
  const PosePrior prior{truth_.Inverse(), Eigen::Matrix3d::Identity() / (sigma_m * sigma_m)};
  for (const double direction_sigma_rad : {0.05, 0.2}) {
    const DirectionPrior way{truth_.translation - last_.world_from_camera.translation, direction_sigma_rad};
    const ExpectedFrame expected{truth_, way, prior, turn_sigma_rad};
    const auto found = Follow(Faded(Take(), 6), expected);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->is_doubtful, direction_sigma_rad > 0.1);
  }
}

TEST_F(FrameSearchTest, DoesNotBelieveATurnThatIsNotSteady) {
  const double sigma_m = 0.005;
  const PosePrior prior{truth_.Inverse(), Eigen::Matrix3d::Identity() / (sigma_m * sigma_m)};
  const ExpectedFrame expected{.world_from_camera = truth_, .prior = prior, .turn_sigma_rad = 0.1};
  const auto found = Follow(Faded(Take(), 6), expected);
  ASSERT_TRUE(found.has_value());
  EXPECT_TRUE(found->is_doubtful);
}

// A camera went on, and a lorry that drives in front has most of the points: as these show it, the camera stands.
class LorryInFront : public testing::Test {
 protected:
  using Place = std::function<bool(const Keypoint&)>;

  // What the camera sees from its new place, one in `scene_every` keypoints, but where the lorry is.
  FeatureFrame Take(const Place& is_lorry, size_t scene_every) {
    FeatureFrame seen = world_.Take(1, truth_).features, taken = seen;
    taken.keypoints.clear();
    taken.descriptors.clear();
    const auto add = [&taken](const FeatureFrame& from, size_t i) {
      taken.keypoints.push_back(from.keypoints[i]);
      taken.descriptors.push_back(from.descriptors[i]);
    };
    for (size_t i = 0; i < seen.keypoints.size(); i += scene_every) {
      if (!is_lorry(seen.keypoints[i])) add(seen, i);
    }
    for (size_t i = 0; i < before_.keypoints.size(); ++i) {
      if (is_lorry(before_.keypoints[i])) add(before_, i);
    }
    return taken;
  }
  std::optional<FoundFrame> Follow(const FeatureFrame& features, const ExpectedFrame& expected) const {
    return FrameSearch(ViewOf(features), last_, expected, replica_, options_).Follow();
  }

  SyntheticWorld world_{SensorType::kStereo, 0.3};
  const TrackedFrame last_ = world_.TrackedAt(0);
  const FeatureFrame before_ = world_.Take(0).features;
  const Rigid3 truth_ = SyntheticWorld::Pose(3.0);
  const FrameSearchOptions options_;
  const MapReplica replica_;
};

TEST_F(LorryInFront, APoseThatGoesOnWinsAgainstMorePointsThatMakeTheCameraJump) {
  int number = 0;
  const FeatureFrame features = Take([&number](const Keypoint&) { return ++number % 3 != 0; }, 1);
  const DirectionPrior way{truth_.translation - last_.world_from_camera.translation, 0.2};
  ExpectedFrame expected{.world_from_camera = truth_, .way = way};
  const auto carried = Follow(features, expected);
  expected.max_off = 0.1;
  const auto steady = Follow(features, expected);
  ASSERT_TRUE(carried.has_value() && steady.has_value());
  EXPECT_THAT(carried->frame.world_from_camera, IsNear(last_.world_from_camera, 0.05));
  EXPECT_THAT(steady->frame.world_from_camera, IsNear(truth_, 0.05));
}

TEST_F(LorryInFront, BeforeAMotionIsKnownTheSceneIsWhatTakesMoreOfTheImage) {
  const CameraCalibration camera = world_.calibration();
  const auto is_lorry = [&camera](const Keypoint& keypoint) {
    return keypoint.x_px < 0.3F * static_cast<float>(camera.width_px);
  };
  const FeatureFrame features = Take(is_lorry, 3);
  const auto num_lorry = std::ranges::count_if(features.keypoints, is_lorry);
  ASSERT_GT(num_lorry, static_cast<int64_t>(features.keypoints.size()) - num_lorry) << "it has most of the points";
  const auto found = Follow(features, {.world_from_camera = last_.world_from_camera});
  ASSERT_TRUE(found.has_value());
  EXPECT_THAT(found->frame.world_from_camera, IsNear(truth_, 0.05));
}

TEST_F(FrameSearchTest, TwoFramesByThemselvesContradictAnotherTurn) {
  const Rigid3 turned = truth_ * Rigid3{ExpSO3({0.0, 0.1, 0.0}), Eigen::Vector3d::Zero()};
  FrameSearch search(ViewOf(Take()), last_, {.world_from_camera = turned, .turn_sigma_rad = 0.1}, replica_, options_);
  EXPECT_FALSE(search.PairContradicts(truth_));
  EXPECT_TRUE(search.PairContradicts(turned));
  // A turn that was known beforehand is known better.
  FrameSearch steady(ViewOf(Take()), last_, {.world_from_camera = turned, .turn_sigma_rad = 0.001}, replica_, options_);
  EXPECT_FALSE(steady.PairContradicts(turned));
}

TEST_F(FrameSearchTest, FindsNothingWhereNothingIsSeenAgain) {
  const FeatureFrame strange = Faded(Take(), 1000000);
  EXPECT_FALSE(Follow(strange, {.world_from_camera = truth_}).has_value());
}

TEST_F(FrameSearchTest, FindsAFrameAnywhereByDescriptorsAlone) {
  FrameSearch search(ViewOf(Take()), last_, {.world_from_camera = Rigid3{ExpSO3({0.0, 2.0, 0.0}), {9.0, 0.0, 0.0}}},
                     replica_, options_);
  ASSERT_TRUE(search.FindAnywhere().has_value());
  EXPECT_THAT(search.FindAnywhere()->frame.world_from_camera, IsNear(truth_, 0.02));
}

TEST_F(FrameSearchTest, FindsAFrameAnywhereThoughMostMatchesAreWrong) {
  FeatureFrame features = Take();
  // Three of four keypoints look like others of them.
  for (size_t i = 0; i < features.descriptors.size(); ++i) {
    if (i % 4 != 0) features.keypoints[i].x_px = features.keypoints[(i * 7 + 3) % features.keypoints.size()].x_px;
  }
  FrameSearch search(ViewOf(features), last_, {.world_from_camera = Rigid3{ExpSO3({0.0, 2.0, 0.0}), {9.0, 0.0, 0.0}}},
                     replica_, options_);
  ASSERT_TRUE(search.FindAnywhere().has_value());
  EXPECT_THAT(search.FindAnywhere()->frame.world_from_camera, IsNear(truth_, 0.05));
}

TEST_F(FrameSearchTest, TwoFramesByThemselvesShowThePose) {
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    SyntheticWorld world(sensor, 0.3);
    const TrackedFrame last = world.TrackedAt(0);
    FrameSearch search(ViewOf(world.Take(1).features), last, {.world_from_camera = truth_}, replica_, options_);
    ASSERT_TRUE(search.PoseByPair().has_value());
    EXPECT_THAT(*search.PoseByPair(), IsNear(truth_, 0.1));
  }
}

TEST(FrameSearchOptions, AreChecked) {
  EXPECT_THAT(FrameSearchOptions{}.Check(), IsSuccess());
  EXPECT_THAT(FrameSearchOptions{.max_local_keyframes = 0}.Check(), IsFailure(HasSubstr("max_local_keyframes")));
}

}  // namespace
}  // namespace tessera
