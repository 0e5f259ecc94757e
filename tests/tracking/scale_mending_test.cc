#include "tracking/scale_mending.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

constexpr double kLogHeight = 0.7;

// A camera that goes 10 heights a second; three steps from each keyframe.
class Way {
 public:
  // `log_factor`: what lengths in the map are to be multiplied by; `is_told`: the ground is seen.
  void Go(int num_steps, double log_factor, bool is_told = true, double speed = 10.0) {
    for (int i = 0; i < num_steps; ++i) {
      const KeyframeId reference{static_cast<int64_t>(steps_.size()) / 3};
      steps_.push_back({reference, kLogHeight + std::log(speed) - log_factor});
      if (is_told) steps_.back().log_ground_speed = std::log(speed);
    }
  }
  std::vector<GroundStep>& steps() { return steps_; }

 private:
  std::vector<GroundStep> steps_;
};

TEST(ScaleMending, NothingIsToBeMendedWhereTheHeightIsAsItWas) {
  Way way;
  way.Go(60, 0.1);
  EXPECT_EQ(NumSound(way.steps(), kLogHeight), 60U);
  EXPECT_TRUE(MendingsOf(way.steps(), kLogHeight).empty());
}

TEST(ScaleMending, FindsWhereTheScaleFellOrRoseAndByHowMuch) {
  for (const double slip : {1.5, -1.2}) {
    Way way;
    way.Go(60, 0.0);
    way.Go(60, slip);
    EXPECT_EQ(NumSound(way.steps(), kLogHeight), 60U);
    const std::vector<ScaleMending> mendings = MendingsOf(way.steps(), kLogHeight);
    ASSERT_EQ(mendings.size(), 20U);
    for (size_t i = 0; i < mendings.size(); ++i) {
      EXPECT_EQ(mendings[i].keyframe, KeyframeId{20 + static_cast<int64_t>(i)});
      EXPECT_NEAR(mendings[i].log_factor, slip, 1e-9);
    }
  }
}

TEST(ScaleMending, FollowsAScaleThatFallsBitByBit) {
  Way way;
  way.Go(30, 0.0);
  for (int i = 0; i < 60; ++i) way.Go(1, 0.02 * i);
  const std::vector<ScaleMending> mendings = MendingsOf(way.steps(), kLogHeight);
  ASSERT_FALSE(mendings.empty());
  EXPECT_NEAR(mendings.front().log_factor, 0.3, 0.1) << "behind the last that are near";
  EXPECT_NEAR(mendings.back().log_factor, 1.18, 0.1);
  for (size_t i = 1; i < mendings.size(); ++i) EXPECT_GE(mendings[i].log_factor, mendings[i - 1].log_factor);
}

// The ground is not seen while the scale slips by a factor of 50, and the camera becomes faster meanwhile.
TEST(ScaleMending, TheCameraWentOnWhereTheGroundWasNotSeen) {
  Way way;
  way.Go(60, 0.0);
  way.Go(45, std::log(50.0), false, 11.0);
  way.Go(30, std::log(50.0), true, 12.0);
  const std::vector<ScaleMending> mendings = MendingsOf(way.steps(), kLogHeight);
  ASSERT_EQ(mendings.size(), 25U);
  for (const ScaleMending& mending : mendings) EXPECT_NEAR(mending.log_factor, std::log(50.0), 0.1);
}

TEST(ScaleMending, SingleWrongAnswersOfTheGroundChangeNothing) {
  Way way;
  way.Go(60, 0.0);
  way.Go(60, 1.0);
  for (size_t i = 5; i < way.steps().size(); i += 7) *way.steps()[i].log_ground_speed += i % 2 == 0 ? 1.0 : -2.0;
  const std::vector<ScaleMending> mendings = MendingsOf(way.steps(), kLogHeight);
  ASSERT_FALSE(mendings.empty());
  EXPECT_GE(mendings.front().keyframe, KeyframeId{17});
  for (const ScaleMending& mending : mendings) {
    EXPECT_NEAR(mending.log_factor, 1.0, mending.keyframe < KeyframeId{22} ? 1.1 : 1e-9);
  }
}

TEST(ScaleMending, APartThatBeganInAWrongScaleIsMendedAsAWhole) {
  Way way;
  way.Go(15, 0.6, false);
  way.Go(30, 0.6);
  EXPECT_EQ(NumSound(way.steps(), kLogHeight), 0U);
  const std::vector<ScaleMending> mendings = MendingsOf(way.steps(), kLogHeight);
  ASSERT_EQ(mendings.size(), 15U);
  for (const ScaleMending& mending : mendings) EXPECT_NEAR(mending.log_factor, 0.6, 1e-9);
}

}  // namespace
}  // namespace tessera
