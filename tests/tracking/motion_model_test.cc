// How the camera moved a moment ago, as a prior for how it moves now.
#include "tracking/motion_model.h"

#include <gtest/gtest.h>

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

TEST(MotionModel, GoesOnInTimeNotInFrames) {
  const MotionModel model = Driven(0.5, 0.0);
  for (const int num_intervals : {1, 3}) {
    const auto motion = model.Predict(num_intervals * kInterval);
    ASSERT_TRUE(motion);
    EXPECT_NEAR(motion->last_from_current.translation.z(), 0.5 * num_intervals, 1e-12);
    EXPECT_NEAR(LogSO3(motion->last_from_current.rotation).y(), 0.02 * num_intervals, 1e-12);
  }
}

TEST(MotionModel, IsAsUncertainAsTheLastSecondsWereRestless) {
  const auto calm = Driven(0.5, 1e-3).Predict(kInterval), restless = Driven(0.5, 1e-2).Predict(kInterval);
  EXPECT_GT(restless->covariance.trace(), 30.0 * calm->covariance.trace());
  // A change of velocity from motion to motion, of variance 2 noise^2 / interval^2 an axis: so much is expected next.
  EXPECT_NEAR(std::sqrt(restless->covariance(2, 2)), std::sqrt(2.0) * 1e-2, 0.4e-2);
}

TEST(MotionModel, GrowsMoreUncertainWithTime) {
  const MotionModel model = Driven(0.5);
  EXPECT_GT(model.Predict(3 * kInterval)->covariance(2, 2), 20.0 * model.Predict(kInterval)->covariance(2, 2));
}

TEST(MotionModel, IsSteadyOnceItHasSeenEnoughOfAMovingCamera) {
  EXPECT_TRUE(Driven(0.5).Predict(kInterval)->is_steady);
  EXPECT_FALSE(Driven(0.5, 1e-3, 5).Predict(kInterval)->is_steady);
  EXPECT_FALSE(Driven(0.0).Predict(kInterval)->is_steady);  // a camera that stands may start at any time
}

TEST(MotionModel, ForgetsWhenReset) {
  MotionModel model = Driven(0.5);
  model.Reset();
  EXPECT_FALSE(model.Predict(kInterval));
}

TEST(IsStepWeak, LooksAlongTheStepAlone) {
  const MotionPrediction motion{{Eigen::Quaterniond::Identity(), {0.0, 0.0, 1.0}}, kCovariance, true};
  const auto sigmas = [](double aside, double along) {
    return Eigen::Matrix3d(Eigen::Vector3d(aside * aside, aside * aside, along * along).asDiagonal());
  };
  EXPECT_FALSE(IsStepWeak(motion, sigmas(0.05, 0.1)));
  EXPECT_TRUE(IsStepWeak(motion, sigmas(0.05, 0.3)));
  EXPECT_FALSE(IsStepWeak(motion, sigmas(0.3, 0.05)));
}

}  // namespace
}  // namespace tessera
