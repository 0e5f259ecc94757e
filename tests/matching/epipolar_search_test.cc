// Second views along epipolar lines on the synthetic world, where it is known which keypoint shows which point.
#include "matching/epipolar_search.h"

#include <gtest/gtest.h>

#include "measurement/landmark_view.h"
#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

bool AnyKeypoint(int32_t) { return true; }

class EpipolarPairs : public testing::Test {
 protected:
  SyntheticWorld world_{SensorType::kMono, 0.3};
  const SyntheticWorld::Picture first_ = world_.Take(0), second_ = world_.Take(2);
  const Rigid3 second_from_first_ = SyntheticWorld::Pose(2).Inverse() * SyntheticWorld::Pose(0);
  const EpipolarOptions options_{.min_parallax_per_turn = 0.0};
};

TEST_F(EpipolarPairs, AreOfTheSamePointAndShowWhereItIs) {
  const EpipolarSearch search(first_.features, second_.features, second_from_first_, AnyKeypoint, 1.0, options_);
  int num = 0, num_true = 0, num_near = 0;
  for (size_t i = 0; i < first_.points.size(); ++i) {
    const auto match = search.Find(static_cast<int32_t>(i));
    if (!match) continue;
    ++num;
    if (second_.points[static_cast<size_t>(match->keypoint)] != first_.points[i]) continue;
    ++num_true;
    const Eigen::Vector3d truth = SyntheticWorld::Pose(0).Inverse() * world_.point(first_.points[i]);
    num_near += (match->point_in_first - truth).norm() < 0.3 * truth.norm() ? 1 : 0;
  }
  EXPECT_GT(num, 200);
  EXPECT_GT(num_true, 0.97 * num);
  EXPECT_GT(num_near, 0.8 * num_true);
}

TEST_F(EpipolarPairs, TakeFreeKeypointsOnly) {
  const auto is_even = [](int32_t keypoint) { return keypoint % 2 == 0; };
  const EpipolarSearch search(first_.features, second_.features, second_from_first_, is_even, 1.0, options_);
  int num = 0;
  for (int32_t i = 0; i < static_cast<int32_t>(first_.points.size()); ++i) {
    const auto match = search.Find(i);
    if (!match) continue;
    ++num;
    EXPECT_EQ(match->keypoint % 2, 0);
  }
  EXPECT_GT(num, 100);
}

// The camera turns to the right by a quarter of its view: what lies at the right side now, and far away, did not stand
// in the image before.
TEST_F(EpipolarPairs, AreNotLookedForWhereAFarPointHasNone) {
  const Rigid3 turned = SyntheticWorld::Pose(2) * Rigid3{ExpSO3({0.0, 0.4, 0.0}), Eigen::Vector3d::Zero()};
  const SyntheticWorld::Picture now = world_.Take(3, turned);
  const Rigid3 before_from_now = SyntheticWorld::Pose(0).Inverse() * turned;
  const EpipolarSearch search(now.features, first_.features, before_from_now, AnyKeypoint, 1.0, options_);
  int num_inside = 0;
  for (size_t i = 0; i < now.points.size(); ++i) {
    const PixelObservation seen = SeenAt(now.features, static_cast<int32_t>(i));
    const Eigen::Vector3d far = before_from_now.rotation * world_.calibration().Ray(seen.pixel_px);
    const bool is_inside = far.z() > 0.0 && IsInImage(world_.calibration(), world_.calibration().Project(far));
    const bool is_found = search.Find(static_cast<int32_t>(i)).has_value();
    num_inside += is_inside && is_found ? 1 : 0;
    EXPECT_TRUE(is_inside || !is_found) << "keypoint " << i;
  }
  EXPECT_GT(num_inside, 50);

  const EpipolarOptions anywhere{.min_parallax_per_turn = 0.0, .needs_far_end = false};
  const EpipolarSearch trusting(now.features, first_.features, before_from_now, AnyKeypoint, 1.0, anywhere);
  int num_found = 0;
  for (size_t i = 0; i < now.points.size(); ++i) num_found += trusting.Find(static_cast<int32_t>(i)) ? 1 : 0;
  EXPECT_GT(num_found, num_inside);
}

// A pair that agrees no better than keypoints far from its line do is one by chance.
TEST_F(EpipolarPairs, AreNotMadeOfWhatLooksAlikeEverywhere) {
  SyntheticWorld::Picture repeated = second_;
  const auto num_found = [&](const FeatureFrame& second) {
    const EpipolarSearch search(first_.features, second, second_from_first_, AnyKeypoint, 1.0, options_);
    int num = 0;
    for (size_t i = 0; i < first_.points.size(); ++i) num += search.Find(static_cast<int32_t>(i)) ? 1 : 0;
    return num;
  };
  const int num_without = num_found(second_.features);
  // What each point looks like is seen in forty other places too.
  const auto num_keypoints = static_cast<int32_t>(repeated.points.size());
  for (int32_t i = 0; i < num_keypoints; ++i) {
    for (int32_t k = 1; k <= 40; ++k) {
      Keypoint copy = second_.features.keypoints[Index((i + k * num_keypoints / 41) % num_keypoints)];
      const Keypoint& original = second_.features.keypoints[Index(i)];
      copy.level = original.level;
      copy.angle = original.angle;
      repeated.features.keypoints.push_back(copy);
      repeated.features.descriptors.push_back(second_.features.descriptors[Index(i)]);
    }
  }
  EXPECT_GT(num_without, 200);
  EXPECT_LT(num_found(repeated.features), num_without / 4);
}

TEST(EpipolarOptions, OutOfRangeIsRefused) {
  EXPECT_THAT(EpipolarOptions{.max_by_chance = 0.0}.Check(), IsFailure(HasSubstr("by chance")));
  EXPECT_THAT(EpipolarOptions{}.Check(), IsSuccess());
  EXPECT_THAT(EpipolarOptions{.min_parallax_sigmas = 0.0}.Check(), IsFailure(HasSubstr("parallax")));
  EXPECT_THAT(EpipolarOptions{.max_hamming = 0}.Check(), IsFailure(HasSubstr("256")));
}

}  // namespace
}  // namespace tessera
