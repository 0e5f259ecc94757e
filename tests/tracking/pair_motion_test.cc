// A wide step by the keypoints of two frames, on the synthetic world.
#include "tracking/pair_motion.h"

#include <gtest/gtest.h>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

TrackedFrame KnowsFirst(TrackedFrame frame, size_t num_known) {
  for (size_t i = num_known; i < frame.points.size(); ++i) frame.points[i] = {};
  return frame;
}

class PairMotion : public testing::Test {
 protected:
  SyntheticWorld world_{SensorType::kMono, 0.3};
  const TrackedFrame last_ = world_.TrackedAt(0);
  // A meter ahead, turned by 17 degrees.
  const Rigid3 last_from_current_{ExpSO3({0.0, 0.3, 0.0}), {0.1, 0.0, 1.0}};
  const std::shared_ptr<const FrameView> current_ =
      ViewOf(world_.Take(1, last_.world_from_camera* last_from_current_).features);
};

TEST_F(PairMotion, KnownPointsTellItsLength) {
  const auto motion = EstimatePairMotion(last_, *current_, std::nullopt, {});
  ASSERT_TRUE(motion.has_value());
  EXPECT_THAT(*motion, IsNear(last_from_current_, 0.1));
}

TEST_F(PairMotion, WithoutKnownPointsTheExpectedStepTellsIt) {
  const auto motion = EstimatePairMotion(KnowsFirst(last_, 0), *current_, DirectionPrior{{0.0, 0.0, 2.0}, 0.2}, {});
  ASSERT_TRUE(motion.has_value());
  EXPECT_NEAR(motion->translation.norm(), 2.0, 1e-9);
  EXPECT_GT(motion->translation.normalized().dot(last_from_current_.translation.normalized()), 0.99);
}

TEST_F(PairMotion, MeasuredDepthsTellItsLengthWherePointsAreUnknown) {
  SyntheticWorld world(SensorType::kStereo, 0.3);
  const TrackedFrame last = KnowsFirst(world.TrackedAt(0), 0);
  const auto current = ViewOf(world.Take(1, last.world_from_camera * last_from_current_).features);
  const auto motion = EstimatePairMotion(last, *current, std::nullopt, {});
  ASSERT_TRUE(motion.has_value());
  EXPECT_THAT(*motion, IsNear(last_from_current_, 0.1));
}

TEST_F(PairMotion, IsUnknownIfItsLengthIsOrItGoesElsewhereThanExpected) {
  const TrackedFrame unknown = KnowsFirst(last_, 0);
  EXPECT_FALSE(EstimatePairMotion(unknown, *current_, std::nullopt, {}).has_value());
  EXPECT_FALSE(EstimatePairMotion(unknown, *current_, DirectionPrior{{0.0, 0.0, -1.0}, 0.2}, {}).has_value());
}

TEST(PairMotionOptions, AreChecked) {
  EXPECT_THAT(PairMotionOptions{}.Check(), IsSuccess());
  EXPECT_THAT(PairMotionOptions{.min_known_points = 0}.Check(), IsFailure(HasSubstr("known point")));
}

}  // namespace
}  // namespace tessera
