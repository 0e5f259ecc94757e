#include "tracking/reference_keyframe.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/matchers.h"
#include "support/synthetic_world.h"
#include "tracking/localized_frame.h"

namespace tessera {
namespace {

// Half a meter forward in each tenth of a second.
ReferenceKeyframe MovingSteadily() {
  ReferenceKeyframe reference{.id = KeyframeId{3}};
  reference.motion = ReferenceKeyframe::MotionAt{{}, 1'000'000};
  for (int i = 0; i < 30; ++i) {
    reference.motion->model.Add(Rigid3{Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.5}},
                                1e-6 * Eigen::Matrix3d::Identity(), 0.1);
  }
  return reference;
}

TEST(ReferenceKeyframe, ExpectsACameraToGoOnAsItMoved) {
  const MotionPrior expected = MovingSteadily().ExpectAt(Rigid3{}, 1'200'000);
  ASSERT_TRUE(expected.is_known());
  EXPECT_LT((expected.position_in_reference - Eigen::Vector3d(0.0, 0.0, 1.0)).norm(), 1e-6);
  EXPECT_EQ(expected.information, expected.information.transpose());
}

TEST(ReferenceKeyframe, ExpectsNothingOfAnUnknownMotionOrOfAnEarlierTime) {
  EXPECT_FALSE(MovingSteadily().ExpectAt(Rigid3{}, 1'000'000).is_known());
  EXPECT_FALSE(ReferenceKeyframe{}.ExpectAt(Rigid3{}, 1'200'000).is_known());
  ReferenceKeyframe just_begun{.id = KeyframeId{3}};
  just_begun.motion = ReferenceKeyframe::MotionAt{{}, 1'000'000};
  EXPECT_FALSE(just_begun.ExpectAt(Rigid3{}, 1'200'000).is_known());
}

LocalizedFrame Localized(SensorType sensor) {
  SyntheticWorld world(sensor, 0.3);
  LocalizedFrame localized{world.TrackedAt(0), Rigid3{}};
  localized.influences = InfluencesOn(localized.frame);
  return localized;
}

// In mono, points move all together: no two frames share their errors.
TEST(ReferenceKeyframe, SharesTheErrorsOfPointsWhereDepthIsMeasured) {
  for (const SensorType sensor : {SensorType::kStereo, SensorType::kMono}) {
    const auto influences = InfluencesOnReference(Localized(sensor), false);
    ASSERT_TRUE(influences.has_value());
    ASSERT_FALSE(influences->empty());
    EXPECT_TRUE(std::ranges::is_sorted(*influences, {}, &PointInfluence::point));
    for (const PointInfluence& influence : *influences) {
      EXPECT_EQ(influence.point.valid(), sensor == SensorType::kStereo);
    }
  }
}

TEST(ReferenceKeyframe, TheFirstWithDepthIsExactAndTheFirstOfMonoUnknown) {
  const auto with_depth = InfluencesOnReference(Localized(SensorType::kStereo), true);
  ASSERT_TRUE(with_depth.has_value());
  EXPECT_TRUE(with_depth->empty());
  LocalizedFrame mono = Localized(SensorType::kMono);
  mono.influences.reset();
  EXPECT_FALSE(InfluencesOnReference(mono, true).has_value());
}

// Of which nothing else is known.
TEST(ReferenceKeyframe, TakesTheErrorOfTheFirstFrameForItsOwn) {
  const LocalizedFrame frame = Localized(SensorType::kStereo);
  ReferenceKeyframe reference{.id = KeyframeId{3}};
  const Matrix6d covariance = reference.WayCovarianceTo(frame.frame, *frame.influences, frame.frame.world_from_camera);
  EXPECT_TRUE(reference.influences.has_value());
  EXPECT_LT((covariance - 2.0 * PoseCovariance(*frame.influences)).norm(), 1e-9 * covariance.norm());
}

}  // namespace
}  // namespace tessera
