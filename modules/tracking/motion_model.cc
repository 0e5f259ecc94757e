#include "tracking/motion_model.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMemory_s = 2.0;       // of q and r
constexpr int kMinMotions = 10;         // before they are trusted
constexpr double kMinWalkShare = 0.02;  // of the variance of changes: no camera's velocity is constant
constexpr double kMinSteadiness = 5.0;  // |v| in standard deviations: a camera that stands still predicts nothing
constexpr double kWeakShare = 0.2;      // of the step
constexpr double kMaxSigmas = 5.0;
constexpr double kMinShare = 0.7, kMaxShare = 1.4;  // of the predicted length

double LargestEigenvalue(const Eigen::Matrix3d& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(symmetric, Eigen::EigenvaluesOnly).eigenvalues().z();
}

}  // namespace

// Of the latest in what the last seconds showed; at first all count alike.
double MotionModel::MemoryShare(double interval_s) const {
  return std::max(1.0 - std::exp(-interval_s / kMemory_s), 1.0 / (num_motions_ - 1));
}

void MotionModel::LearnNoise(const Eigen::Vector3d& measured, double interval_s) {
  const Eigen::Vector3d change = measured - measured_;
  const double share = MemoryShare(interval_s);
  change_variance_ += share * (change.squaredNorm() / 3.0 - change_variance_);
  change_covariance_ += share * (change.dot(change_) / 3.0 - change_covariance_);
  noise_ = std::clamp(-change_covariance_, 0.0, 0.5 * change_variance_);
  walk_ = std::max(change_variance_ - 2.0 * noise_, kMinWalkShare * change_variance_) / interval_s;
  change_ = change;
}

void MotionModel::Guess(const Rigid3& last_from_current, double interval_s) {
  velocity_ = HalfOf(last_from_current.rotation).conjugate() * last_from_current.translation / interval_s;
  turn_rate_ = LogSO3(last_from_current.rotation) / interval_s;
  is_known_ = true;
}

void MotionModel::Add(const Rigid3& last_from_current, const Eigen::Matrix3d& covariance, double interval_s,
                      bool is_carried) {
  const Eigen::Matrix3d middle_from_last = HalfOf(last_from_current.rotation).toRotationMatrix().transpose();
  const Eigen::Vector3d measured = middle_from_last * last_from_current.translation / interval_s;
  const Eigen::Matrix3d variance =
      middle_from_last * covariance * middle_from_last.transpose() / (interval_s * interval_s);
  const Eigen::Vector3d turn_rate = LogSO3(last_from_current.rotation) / interval_s;
  is_known_ = true;
  ++num_motions_;
  if (num_motions_ > 1) {
    const double squared_change = (turn_rate - turn_rate_).squaredNorm() / 3.0;
    turn_change_variance_ += MemoryShare(interval_s) * (squared_change - turn_change_variance_);
  }
  turn_rate_ = turn_rate;
  if (num_motions_ == 1 || is_carried) {
    velocity_ = measured;
    variance_ = variance;
    change_.setZero();
  } else {
    LearnNoise(measured, interval_s);
    const Eigen::Matrix3d predicted = variance_ + walk_ * interval_s * Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d total = predicted + variance + noise_ * Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d gain = predicted * total.inverse();
    velocity_ += gain * (measured - velocity_);
    variance_ = predicted - gain * predicted;
  }
  measured_ = measured;
}

std::optional<MotionPrediction> MotionModel::Predict(double interval_s) const {
  std::optional<MotionPrediction> prediction = Predict(interval_s, ExpSO3(turn_rate_ * interval_s));
  if (prediction) prediction->turn_sigma_rad = interval_s * std::sqrt(turn_change_variance_);
  return prediction;
}

std::optional<MotionPrediction> MotionModel::Predict(double interval_s,
                                                     const Eigen::Quaterniond& last_from_current) const {
  if (!is_known_) return std::nullopt;
  const Eigen::Matrix3d variance = variance_ + walk_ * interval_s * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d last_from_middle = HalfOf(last_from_current).toRotationMatrix();
  MotionPrediction prediction;
  prediction.last_from_current = {last_from_current, last_from_middle * velocity_ * interval_s};
  prediction.covariance = last_from_middle * variance * last_from_middle.transpose() * (interval_s * interval_s);
  const double squared = velocity_.squaredNorm();
  const double along = velocity_.dot(variance * velocity_);  // |v|^2 times the variance along v
  prediction.is_learned = num_motions_ >= kMinMotions;
  prediction.is_steady = prediction.is_learned && squared * squared > kMinSteadiness * kMinSteadiness * along;
  return prediction;
}

bool IsJump(const MotionPrediction& prediction, const Rigid3& motion, const Eigen::Matrix3d& covariance) {
  const Eigen::Vector3d difference = motion.translation - prediction.last_from_current.translation;
  return difference.dot((prediction.covariance + covariance).inverse() * difference) > 3.0 * kMaxSigmas * kMaxSigmas;
}

StepEvidence Judge(const MotionPrediction& prediction, const Rigid3& by_images, const Eigen::Matrix3d& covariance) {
  if (!prediction.is_learned) return StepEvidence::kStrong;
  if (!prediction.is_steady) {
    const bool is_open = LargestEigenvalue(covariance) > LargestEigenvalue(prediction.covariance);
    return is_open ? StepEvidence::kWeak : StepEvidence::kStrong;
  }
  const Eigen::Vector3d& step = prediction.last_from_current.translation;
  const double squared = step.squaredNorm();
  if (step.dot(covariance * step) > kWeakShare * kWeakShare * squared * squared) return StepEvidence::kWeak;
  const double share = by_images.translation.dot(step) / squared;
  const bool is_plausible = (share >= kMinShare && share <= kMaxShare) || !IsJump(prediction, by_images, covariance);
  return is_plausible ? StepEvidence::kStrong : StepEvidence::kContradictory;
}

}  // namespace tessera
