// When a frame becomes a keyframe, by the share of the reference's points that it still sees.
#include "tracking/keyframe_decision.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr int64_t kIntervalUs = 100000;
constexpr int kNumPoints = 200;

// Frames that see chosen points of the reference's, and a decision that is asked about them in order.
class Decision : public testing::Test {
 protected:
  // A frame `step` intervals after the reference that sees points first .. first + num - 1, from `x` beside it.
  TrackedFrame Frame(int step, int first, int num, double x = 0.0) {
    FeatureFrame features;
    features.frame = {step};
    features.utime_us = step * kIntervalUs;
    features.calibration = calibration_;
    features.keypoints.resize(static_cast<size_t>(num));
    features.descriptors.resize(static_cast<size_t>(num));
    TrackedFrame frame(ViewOf(features));
    frame.world_from_camera.translation.x() = x;
    for (int i = 0; i < num; ++i) {
      frame.points[static_cast<size_t>(i)] = {{{first + i}, {}, -1}, {.position_in_world = {0.0, 0.0, 10.0}}};
    }
    return frame;
  }
  void Start(const KeyframeDecisionOptions& options = {}) {
    decision_.emplace(options);
    decision_->Restart(Frame(0, 0, kNumPoints));
  }
  bool Ask(const TrackedFrame& frame, const KeyframeDecision::NearKeypoints& near = {}) {
    return decision_->Decide(frame, kIntervalUs, {}, near);
  }
  // Asks about the frame after the reference, which sees all its points.
  void AskFirst() { ASSERT_FALSE(Ask(Frame(1, 0, kNumPoints))); }

  CameraCalibration calibration_ = SyntheticWorld(SensorType::kStereo, 0.0, 0).calibration();
  std::optional<KeyframeDecision> decision_;
};

TEST_F(Decision, NoKeyframeWhileTheReferenceIsSeen) {
  Start();
  for (int step = 1; step < 20; ++step) EXPECT_FALSE(Ask(Frame(step, 0, kNumPoints))) << step;
}

TEST_F(Decision, AKeyframeWhereNothingOfTheReferenceIsSeen) {
  Start();
  EXPECT_TRUE(Ask(Frame(1, kNumPoints, kNumPoints)));
}

TEST_F(Decision, TheFirstFrameMayLoseMoreThanLaterOnes) {
  Start({.min_points = 1});
  EXPECT_FALSE(Ask(Frame(1, 0, kNumPoints * 41 / 100)));
  Start({.min_points = 1});
  EXPECT_TRUE(Ask(Frame(1, 0, kNumPoints * 39 / 100)));
}

TEST_F(Decision, AKeyframeBeforeTheShareFallsTooLow) {
  Start();
  AskFirst();
  // 10 % lost over five intervals, so the next frame will see about 88 %.
  EXPECT_FALSE(Ask(Frame(6, 0, kNumPoints * 90 / 100)));
  // 22 % lost over two intervals, so the next frame will see 67 %; 26 %, so it will see 61 %.
  EXPECT_FALSE(Ask(Frame(3, 0, kNumPoints * 78 / 100)));
  EXPECT_TRUE(Ask(Frame(3, 0, kNumPoints * 74 / 100)));

  // Mono needs a keyframe earlier, while both it and the next one see the points.
  calibration_.sensor = SensorType::kMono;
  Start();
  AskFirst();
  EXPECT_FALSE(Ask(Frame(6, 0, kNumPoints * 90 / 100)));
  EXPECT_TRUE(Ask(Frame(3, 0, kNumPoints * 78 / 100)));
}

TEST_F(Decision, SharesCountFromTheFrameAfterTheReference) {
  Start({.min_points = 1});
  EXPECT_FALSE(Ask(Frame(1, 0, kNumPoints / 2)));
  for (int step = 2; step < 10; ++step) EXPECT_FALSE(Ask(Frame(step, 0, kNumPoints / 2))) << step;
}

TEST_F(Decision, AgeAndFewPointsCountOnlyIfSomethingMoved) {
  Start({.max_interval_us = 10 * kIntervalUs});
  AskFirst();
  EXPECT_FALSE(Ask(Frame(11, 0, kNumPoints * 95 / 100))) << "old, but it stands still";
  EXPECT_FALSE(Ask(Frame(10, 0, kNumPoints * 88 / 100))) << "moved, but not old";
  EXPECT_TRUE(Ask(Frame(11, 0, kNumPoints * 88 / 100)));

  Start({.min_points = kNumPoints});
  EXPECT_FALSE(Ask(Frame(1, 0, kNumPoints)));
  EXPECT_TRUE(Ask(Frame(10, 0, kNumPoints * 88 / 100)));
}

TEST_F(Decision, ParallaxIsAReasonForMonoAlone) {
  const TrackedFrame aside = Frame(10, 0, kNumPoints * 88 / 100, 0.5);  // 0.05 rad at 10 m
  Start();
  AskFirst();
  EXPECT_FALSE(Ask(aside));

  calibration_.sensor = SensorType::kMono;
  Start();
  AskFirst();
  EXPECT_FALSE(Ask(Frame(9, 0, kNumPoints * 88 / 100, 0.2)));
  EXPECT_TRUE(Ask(Frame(10, 0, kNumPoints * 88 / 100, 0.5)));
}

TEST_F(Decision, AKeyframeBeforeTheCameraTurnsAwayFromTheReference) {
  const auto after_turn = [&](SensorType sensor, double turn_rad) {
    calibration_ = SyntheticWorld(sensor, 0.0, 0).calibration();
    Start();
    TrackedFrame frame = Frame(1, 0, kNumPoints);
    frame.world_from_camera.rotation = ExpSO3({0.0, turn_rad, 0.0});
    return Ask(frame);
  };
  const double field_of_view_rad = 2.0 * std::atan(0.5 * calibration_.width_px / calibration_.fx_px);
  for (const SensorType sensor : {SensorType::kMono, SensorType::kStereo}) {
    EXPECT_FALSE(after_turn(sensor, 0.19 * field_of_view_rad));
    EXPECT_TRUE(after_turn(sensor, 0.21 * field_of_view_rad)) << "as far again makes more than two fifths";
  }
}

TEST_F(Decision, ManyNewNearKeypointsAndFewKnownOnesMakeAKeyframe) {
  Start();
  EXPECT_TRUE(Ask(Frame(1, 0, kNumPoints), {.num_known = 99, .num_new = 71}));
  Start();
  EXPECT_FALSE(Ask(Frame(1, 0, kNumPoints), {.num_known = 100, .num_new = 71}));
  EXPECT_FALSE(Ask(Frame(2, 0, kNumPoints), {.num_known = 99, .num_new = 70}));
}

TEST_F(Decision, ARestartTakesANewReference) {
  Start();
  AskFirst();
  decision_->Restart(Frame(5, 1000, kNumPoints));
  EXPECT_FALSE(Ask(Frame(6, 1000, kNumPoints)));
  EXPECT_TRUE(Ask(Frame(7, 0, kNumPoints)));
}

TEST(KeyframeDecisionOptions, AreChecked) {
  EXPECT_THAT(KeyframeDecisionOptions().Check(), IsSuccess());
  EXPECT_THAT((KeyframeDecisionOptions{.min_share = 1.0}).Check(), IsFailure(HasSubstr("between 0 and 1")));
  EXPECT_THAT((KeyframeDecisionOptions{.min_parallax_rad = 0.0}).Check(), IsFailure(HasSubstr("positive")));
}

}  // namespace
}  // namespace tessera
