#include "tracking/motion_model.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMemory = 2.0;         // seconds that q remembers
constexpr int kMinMotions = 10;         // before q is trusted
constexpr double kMinSteadiness = 5.0;  // |v| in standard deviations: a camera that stands still predicts nothing
constexpr double kWeakShare = 0.2;      // of the step
constexpr double kMinWalkShare = 0.01;  // q is at least (this share of |v|)^2 a second

}  // namespace

void MotionModel::Add(const Rigid3& last_from_current, const Eigen::Matrix3d& covariance, double interval_s) {
  const Eigen::Vector3d velocity = last_from_current.translation / interval_s;
  if (num_motions_ > 0) {
    const double sample = (velocity - velocity_).squaredNorm() / 3.0 / interval_s;
    const double share = std::max(1.0 - std::exp(-interval_s / kMemory), 1.0 / num_motions_);
    walk_ += share * (sample - walk_);
  }
  velocity_ = velocity;
  turn_rate_ = LogSO3(last_from_current.rotation) / interval_s;
  variance_ = covariance / (interval_s * interval_s);
  ++num_motions_;
}

std::optional<MotionPrediction> MotionModel::Predict(double interval_s) const {
  if (num_motions_ == 0) return std::nullopt;
  const double walk = std::max(walk_, kMinWalkShare * kMinWalkShare * velocity_.squaredNorm());
  const Eigen::Matrix3d variance = variance_ + walk * interval_s * Eigen::Matrix3d::Identity();
  MotionPrediction prediction;
  prediction.last_from_current = {ExpSO3(turn_rate_ * interval_s), velocity_ * interval_s};
  prediction.covariance = variance * (interval_s * interval_s);
  const double along = velocity_.dot(variance * velocity_);  // |v|^2 times the variance along v
  prediction.is_steady = num_motions_ >= kMinMotions &&
                         velocity_.squaredNorm() * velocity_.squaredNorm() > kMinSteadiness * kMinSteadiness * along;
  return prediction;
}

bool IsStepWeak(const MotionPrediction& prediction, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d& step = prediction.last_from_current.translation;
  const double squared = step.squaredNorm();
  return step.dot(covariance * step) > kWeakShare * kWeakShare * squared * squared;
}

}  // namespace tessera
