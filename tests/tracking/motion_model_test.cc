// How the camera moved a moment ago, as a prior for how it moves now.
#include "tracking/motion_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tessera {
namespace {

constexpr double kInterval = 0.1;  // s
const Eigen::Matrix3d kCovariance = 1e-6 * Eigen::Matrix3d::Identity();

// Ten motions a second along z, by `step` each, with a little noise.
MotionModel Driven(double step, double noise = 1e-3, int num = 30) {
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal(0.0, noise);
  MotionModel model;
  for (int i = 0; i < num; ++i) {
    const Eigen::Vector3d translation(normal(generator), normal(generator), step + normal(generator));
    model.Add({ExpSO3({0.0, 0.02, 0.0}), translation}, kCovariance, kInterval);
  }
  return model;
}

TEST(MotionModel, PredictsNothingBeforeTheFirstMotion) { EXPECT_FALSE(MotionModel().Predict(kInterval)); }

// What two views show before there is a map says where to look first; what the camera does then counts alone.
TEST(MotionModel, AGuessLeadsUntilTheFirstMotion) {
  MotionModel guessed, other;
  guessed.Guess({ExpSO3({0.0, 0.04, 0.0}), {0.0, 0.0, 1.0}}, 2.0 * kInterval);
  const auto motion = guessed.Predict(kInterval);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->last_from_current.translation.norm(), 0.5, 1e-12);
  EXPECT_NEAR(LogSO3(motion->last_from_current.rotation).y(), 0.02, 1e-12);
  EXPECT_FALSE(motion->is_steady);
  for (MotionModel* model : {&guessed, &other}) {
    model->Add({Eigen::Quaterniond::Identity(), {0.3, 0.0, 0.0}}, kCovariance, kInterval);
    model->Add({Eigen::Quaterniond::Identity(), {0.4, 0.0, 0.0}}, kCovariance, kInterval);
  }
  EXPECT_EQ(guessed.Predict(kInterval)->last_from_current.translation,
            other.Predict(kInterval)->last_from_current.translation);
  EXPECT_EQ(guessed.Predict(kInterval)->covariance, other.Predict(kInterval)->covariance);
}

// 0.5 along a turn of 0.02 rad each: after n motions n / 2 away on a circle, in the direction of its chord.
TEST(MotionModel, GoesOnInTimeNotInFrames) {
  const MotionModel model = Driven(0.5, 0.0);
  for (const int num_intervals : {1, 3}) {
    const auto motion = model.Predict(num_intervals * kInterval);
    ASSERT_TRUE(motion);
    const Eigen::Vector3d& way = motion->last_from_current.translation;
    EXPECT_NEAR(way.norm(), 0.5 * num_intervals, 1e-12);
    EXPECT_NEAR(std::atan2(way.x(), way.z()), 0.01 * (num_intervals - 1), 1e-12);
    EXPECT_NEAR(LogSO3(motion->last_from_current.rotation).y(), 0.02 * num_intervals, 1e-12);
  }
}

TEST(MotionModel, FollowsATurnThatIsKnown) {
  const auto motion = Driven(0.5, 0.0).Predict(kInterval, ExpSO3({0.0, 0.3, 0.0}));
  ASSERT_TRUE(motion);
  const Eigen::Vector3d& way = motion->last_from_current.translation;
  EXPECT_NEAR(std::atan2(way.x(), way.z()), 0.15 - 0.01, 1e-12) << "the chord of the turn, not its tangent";
  EXPECT_NEAR(LogSO3(motion->last_from_current.rotation).y(), 0.3, 1e-12);
}

TEST(MotionModel, IsAsUncertainAsTheLastSecondsWereRestless) {
  const auto calm = Driven(0.5, 1e-3).Predict(kInterval), restless = Driven(0.5, 1e-2).Predict(kInterval);
  EXPECT_GT(restless->covariance.trace(), 20.0 * calm->covariance.trace());
}

// A walker's turns come and go between two images: how the last one turned says little of the next.
TEST(MotionModel, KnowsATurnAsWellAsTheLastOnesWereSteady) {
  MotionModel walker;
  for (int i = 0; i < 30; ++i)
    walker.Add({ExpSO3({0.0, i % 2 == 0 ? 0.1 : 0.2, 0.0}), {0.0, 0.0, 1.0}}, kCovariance, 0.5);
  EXPECT_NEAR(walker.Predict(0.5)->turn_sigma_rad, 0.1 / std::sqrt(3.0), 1e-9);
  EXPECT_LT(Driven(0.5).Predict(kInterval)->turn_sigma_rad, 1e-9);
}

TEST(MotionModel, TellsNoiseOfPosesFromMotion) {
  // Poses that are 10 mm off, of a camera of constant velocity: the filter knows the velocity better than each of them.
  const auto noisy = Driven(0.5, 1e-2, 100).Predict(kInterval);
  EXPECT_LT(std::sqrt(noisy->covariance(2, 2)), 0.8e-2);
  EXPECT_NEAR(noisy->last_from_current.translation.z(), 0.5, 1.2e-2);
  // A velocity that wanders as much: the next step is as uncertain as the last change was large.
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal(0.0, 1e-2);
  MotionModel wandering;
  double step = 0.5;
  for (int i = 0; i < 100; ++i) {
    step += normal(generator);
    wandering.Add({Eigen::Quaterniond::Identity(), {0.0, 0.0, step}}, kCovariance, kInterval);
  }
  EXPECT_NEAR(wandering.Predict(kInterval)->last_from_current.translation.z(), step, 1e-2);
}

TEST(MotionModel, ACarriedStepTellsNothingAboutTheNoise) {
  // A prediction that comes true to the bit, again and again, because it was the pose: no sign of a calm camera.
  MotionModel model = Driven(0.5, 1e-2);
  const double before = model.Predict(kInterval)->covariance.trace();
  for (int i = 0; i < 50; ++i) {
    const auto motion = model.Predict(kInterval);
    model.Add(motion->last_from_current, motion->covariance, kInterval, true);
  }
  EXPECT_GT(model.Predict(kInterval)->covariance.trace(), before);
}

TEST(MotionModel, GrowsMoreUncertainWithTime) {
  const MotionModel model = Driven(0.5);
  EXPECT_GT(model.Predict(3 * kInterval)->covariance(2, 2), 9.0 * model.Predict(kInterval)->covariance(2, 2));
}

TEST(MotionModel, IsSteadyOnceItHasSeenEnoughOfAMovingCamera) {
  EXPECT_TRUE(Driven(0.5).Predict(kInterval)->is_steady);
  EXPECT_FALSE(Driven(0.5, 1e-3, 5).Predict(kInterval)->is_steady);
  EXPECT_FALSE(Driven(0.0).Predict(kInterval)->is_steady);  // a camera that stands may start at any time
}

TEST(MotionModel, SaysWhereToLookOnceItHasSeenEnoughOfACamera) {
  EXPECT_TRUE(Driven(0.5).Predict(kInterval)->is_learned);
  EXPECT_TRUE(Driven(0.0).Predict(kInterval)->is_learned);
  EXPECT_FALSE(Driven(0.0, 1e-3, 5).Predict(kInterval)->is_learned);
}

TEST(MotionModel, ForgetsWhenReset) {
  MotionModel model = Driven(0.5);
  model.Reset();
  EXPECT_FALSE(model.Predict(kInterval));
}

class JudgeTest : public testing::Test {
 protected:
  static Eigen::Matrix3d Covariance(double aside, double along) {
    return Eigen::Vector3d(aside * aside, aside * aside, along * along).asDiagonal();
  }
  static Rigid3 Step(double along) { return {Eigen::Quaterniond::Identity(), {0.0, 0.0, along}}; }

  MotionPrediction prediction_{Step(1.0), Covariance(0.01, 0.01), true, true};
};

TEST_F(JudgeTest, StrongImagesAreBelieved) {
  EXPECT_EQ(Judge(prediction_, Step(1.02), Covariance(0.01, 0.01)), StepEvidence::kStrong);
  // Far from what was predicted, but nothing that braking could not do.
  EXPECT_EQ(Judge(prediction_, Step(0.75), Covariance(0.01, 0.01)), StepEvidence::kStrong);
}

TEST_F(JudgeTest, WeaknessIsLookedForAlongTheStepAlone) {
  EXPECT_EQ(Judge(prediction_, Step(1.0), Covariance(0.05, 0.3)), StepEvidence::kWeak);
  EXPECT_EQ(Judge(prediction_, Step(1.0), Covariance(0.3, 0.05)), StepEvidence::kStrong);
}

TEST_F(JudgeTest, ASixthOfTheSpeedFromOneFrameToTheNextIsAContradiction) {
  EXPECT_EQ(Judge(prediction_, Step(1.0 / 6.0), Covariance(0.01, 0.01)), StepEvidence::kContradictory);
  EXPECT_EQ(Judge(prediction_, Step(-0.5), Covariance(0.01, 0.01)), StepEvidence::kContradictory);
}

TEST_F(JudgeTest, OfACameraThatStandsImagesKnowMoreUnlessTheyLeaveMoreOpen) {
  prediction_.is_steady = false;
  EXPECT_EQ(Judge(prediction_, Step(1.0 / 6.0), Covariance(0.009, 0.009)), StepEvidence::kStrong);
  EXPECT_EQ(Judge(prediction_, Step(1.0 / 6.0), Covariance(0.009, 0.3)), StepEvidence::kWeak);
}

TEST_F(JudgeTest, OfACameraThatWasHardlySeenImagesAloneKnow) {
  prediction_.is_learned = prediction_.is_steady = false;
  EXPECT_EQ(Judge(prediction_, Step(1.0 / 6.0), Covariance(0.01, 0.3)), StepEvidence::kStrong);
}

}  // namespace
}  // namespace tessera
