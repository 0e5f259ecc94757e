// The height of a camera on a car, and what it tells of the scale.
#include "tracking/ground_watch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support/synthetic_road.h"

namespace tessera {
namespace {

constexpr double kInterval_s = 0.1, kStep_m = 1.0;
constexpr double kPitch_rad = 0.15;

// Drives along the road; the map's units are `units` to the meter.
class Drive {
 public:
  void Go(int num_steps, double units, const std::function<double(int)>& height_m = nullptr) {
    for (int i = 0; i < num_steps; ++i) {
      reference_.value += i % 5 == 0 ? 1 : 0;
      way_m_ += kStep_m;
      if (way_m_ > 220.0) way_m_ -= 200.0, last_ = nullptr;
      const Rigid3 pose = SyntheticRoad::Pose(way_m_, kPitch_rad, height_m ? height_m(i) : SyntheticRoad::kHeight_m);
      const auto view = road_.Take(pose);
      if (last_ != nullptr) {
        Rigid3 last_from_current = last_pose_.Inverse() * pose;
        last_from_current.translation *= units;
        watch_.Add(*last_, *view, {last_from_current, kInterval_s, 0.005, true, reference_});
      }
      last_ = view;
      last_pose_ = pose;
    }
  }
  GroundWatch& watch() { return watch_; }
  SyntheticRoad& road() { return road_; }

 private:
  SyntheticRoad road_{3000};
  GroundWatch watch_;
  KeyframeId reference_{0};
  double way_m_ = 20.0;
  std::shared_ptr<const FrameView> last_;
  Rigid3 last_pose_;
};

TEST(GroundWatch, LearnsTheHeightInUnitsOfTheMap) {
  Drive drive;
  drive.Go(20, 0.04);
  EXPECT_FALSE(drive.watch().height()) << "too soon";
  drive.Go(100, 0.04);
  ASSERT_TRUE(drive.watch().height());
  EXPECT_NEAR(*drive.watch().height() / (0.04 * SyntheticRoad::kHeight_m), 1.0, 0.05);
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0);
}

TEST(GroundWatch, SaysThatTheScaleHasFallenUntilItHasLastedForLong) {
  Drive drive;
  drive.Go(100, 0.04);
  drive.Go(40, 0.03);
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0) << "roads bend by as much";
  drive.Go(30, 0.01);
  EXPECT_NEAR(drive.watch().ScaleFall(), std::log(4.0), 0.15);
  drive.Go(100, 0.01);
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0) << "another height is known";
  ASSERT_TRUE(drive.watch().height());
  EXPECT_NEAR(*drive.watch().height() / (0.01 * SyntheticRoad::kHeight_m), 1.0, 0.05);
}

// From keyframe 20 on, a hundred steps at right scale behind it.
TEST(GroundWatch, MendsAScaleThatHasFallenOnceItStays) {
  Drive drive;
  drive.Go(100, 0.04);
  EXPECT_TRUE(drive.watch().Mendings().empty());
  drive.Go(6, 0.01);
  EXPECT_TRUE(drive.watch().Mendings().empty()) << "too soon";
  drive.Go(34, 0.01);
  const std::vector<ScaleMending> mendings = drive.watch().Mendings();
  ASSERT_FALSE(mendings.empty());
  EXPECT_NEAR(static_cast<double>(mendings.front().keyframe.value), 20.0, 2.0);
  EXPECT_NEAR(mendings.back().log_factor, std::log(4.0), 0.15);
  drive.watch().NoteMended(mendings.back().keyframe);
  drive.Go(60, 0.04);
  EXPECT_TRUE(drive.watch().Mendings().empty());
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0);
  EXPECT_NEAR(*drive.watch().height() / (0.04 * SyntheticRoad::kHeight_m), 1.0, 0.05);
}

// What rises for a moment is a road that falls away.
TEST(GroundWatch, MendsAScaleThatHasRisenOnlyIfItStaysForLong) {
  Drive drive;
  drive.Go(100, 0.04);
  drive.Go(40, 0.12);
  EXPECT_TRUE(drive.watch().Mendings().empty());
  drive.Go(40, 0.12);
  const std::vector<ScaleMending> mendings = drive.watch().Mendings();
  ASSERT_FALSE(mendings.empty());
  EXPECT_NEAR(static_cast<double>(mendings.front().keyframe.value), 20.0, 2.0);
  EXPECT_NEAR(mendings.back().log_factor, -std::log(3.0), 0.15);
}

TEST(GroundWatch, BringsAPartWhoseScaleIsAGuessToThatOfTheOneBefore) {
  for (const double units : {0.15, 0.05, 0.01}) {
    Drive drive;
    drive.Go(100, 0.04);
    drive.watch().BeginPart({21}, true);
    drive.Go(10, units);
    EXPECT_TRUE(drive.watch().Mendings().empty()) << "too soon";
    drive.Go(20, units);
    const std::vector<ScaleMending> mendings = drive.watch().Mendings();
    ASSERT_EQ(mendings.size(), 1U);
    EXPECT_EQ(mendings.front().keyframe, KeyframeId{21});
    EXPECT_NEAR(mendings.front().log_factor, std::log(0.04 / units), 0.1);
    drive.watch().NoteMended({21});
    drive.Go(40, 0.03);
    EXPECT_TRUE(drive.watch().Mendings().empty()) << "nearly right, and a better estimate takes longer";
    drive.Go(30, 0.03);
    const std::vector<ScaleMending> better = drive.watch().Mendings();
    ASSERT_EQ(better.size(), 1U);
    EXPECT_EQ(better.front().keyframe, KeyframeId{21});
    EXPECT_NEAR(better.front().log_factor, std::log(0.04 / 0.03), 0.08);
    drive.watch().NoteMended({21});
    drive.Go(90, 0.035);
    EXPECT_TRUE(drive.watch().Mendings().empty()) << "enough of it";
  }
}

TEST(GroundWatch, LeavesAPartAloneWhoseFirstStepTheGroundHasTold) {
  Drive drive;
  drive.Go(100, 0.04);
  drive.watch().BeginPart({21}, false);
  drive.Go(40, 0.03);
  EXPECT_TRUE(drive.watch().Mendings().empty());
}

TEST(GroundWatch, MendsNothingOfAWayThatIsForgotten) {
  Drive drive;
  drive.Go(100, 0.04);
  drive.Go(40, 0.01);
  drive.watch().ForgetSteps();
  EXPECT_TRUE(drive.watch().Mendings().empty());
  drive.Go(40, 0.01);
  ASSERT_FALSE(drive.watch().Mendings().empty()) << "the height is known";
  EXPECT_GT(drive.watch().Mendings().front().keyframe, KeyframeId{27});
}

TEST(GroundWatch, TellsTheLengthOfAStepAfterAGap) {
  Drive drive;
  drive.Go(100, 0.04);
  const Rigid3 before = SyntheticRoad::Pose(50.0, kPitch_rad), now = SyntheticRoad::Pose(50.8, kPitch_rad);
  Rigid3 last_from_current = before.Inverse() * now;
  last_from_current.translation.normalize();
  const auto length = drive.watch().LengthAfterGap(*drive.road().Take(before), *drive.road().Take(now),
                                                   last_from_current, kInterval_s, 3.0);
  ASSERT_TRUE(length);
  EXPECT_NEAR(*length / (0.04 * 0.8), 1.0, 0.1);
}

TEST(GroundWatch, FollowsALoopThatScalesTheMapAndForgetsWithAnotherPart) {
  Drive drive;
  drive.Go(100, 0.04);
  drive.watch().Rescale(3.0);
  EXPECT_NEAR(*drive.watch().height() / (0.12 * SyntheticRoad::kHeight_m), 1.0, 0.05);
  drive.Go(30, 0.12);
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0);
  drive.watch().ForgetHeight();
  EXPECT_FALSE(drive.watch().height());
  const auto view = drive.road().Take(SyntheticRoad::Pose(50.0, kPitch_rad));
  EXPECT_FALSE(drive.watch().LengthAfterGap(*view, *view, {}, kInterval_s, 0.0));
}

TEST(GroundWatch, SaysNothingOfACameraThatGoesUpAndDown) {
  Drive drive;
  drive.Go(200, 0.04, [](int i) { return 2.2 + 1.5 * std::sin(0.1 * i); });
  EXPECT_FALSE(drive.watch().height());
  EXPECT_EQ(drive.watch().ScaleFall(), 0.0);
}

}  // namespace
}  // namespace tessera
