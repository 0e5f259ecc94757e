#include "tracking/time_offset.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kMinPoints = 50;
// Of what one frame says: its motion isn't known exactly, nor is the map.
constexpr double kFrameSigma_s = 0.01;
// However many frames have been seen: what the first ones said, with a map that was distorted, is forgotten.
constexpr double kMinSigma_s = 0.001;
constexpr double kMinSigmas = 4.0;
constexpr double kMemory = 0.99;  // of ExplainedShare, from frame to frame

}  // namespace

void TimeOffsetEquations::Add(const Eigen::Vector3d& residual, const Eigen::Matrix<double, 3, 6>& by_pose,
                              const Eigen::Vector3d& by_offset, int num_measured) {
  information_.noalias() += by_pose.transpose() * by_pose;
  coupling_.noalias() += by_pose.transpose() * by_offset;
  gradient_.noalias() += by_pose.transpose() * residual;
  offset_information_ += by_offset.squaredNorm();
  offset_gradient_ += by_offset.dot(residual);
  sum_of_squares_ += residual.squaredNorm();
  ++num_points_;
  num_measured_ += num_measured;
}

std::optional<TimeOffsetEquations::Error> TimeOffsetEquations::Solve() const {
  if (num_points_ < kMinPoints) return std::nullopt;
  const Vector6d elimination = information_.ldlt().solve(coupling_);
  const double information = offset_information_ - coupling_.dot(elimination);
  const double seconds = (offset_gradient_ - elimination.dot(gradient_)) / information;
  if (!(information > 0.0) || !std::isfinite(seconds)) return std::nullopt;
  const double noise = sum_of_squares_ / num_measured_;
  return Error{seconds, noise / information, num_measured_};
}

void TimeOffset::Add(const TimeOffsetEquations& equations, double used_s) {
  const std::optional<TimeOffsetEquations::Error> error = equations.Solve();
  if (!error) return;
  const double gain = variance_ / (variance_ + kFrameSigma_s * kFrameSigma_s + error->variance);
  const double change_s = used_s + error->seconds - estimate_s_;
  estimate_s_ += gain * std::clamp(change_s, -kFrameSigma_s, kFrameSigma_s);
  variance_ = std::max((1.0 - gain) * variance_, kMinSigma_s * kMinSigma_s);
  const double weight = 1.0 / error->variance;
  weighted_sum_ = kMemory * weighted_sum_ + weight * (used_s + error->seconds);
  sum_of_weights_ = kMemory * sum_of_weights_ + weight;
  sum_measured_ = kMemory * sum_measured_ + error->num_measured;
  ++num_frames_;
}

double TimeOffset::ExplainedShare() const {
  return num_frames_ > 0 ? weighted_sum_ * weighted_sum_ / (sum_of_weights_ * sum_measured_) : 0.0;
}

double TimeOffset::value_s(double min_s) const {
  const bool is_known = std::abs(estimate_s_) > std::max(min_s, kMinSigmas * std::sqrt(variance_));
  return is_known ? estimate_s_ : 0.0;
}

}  // namespace tessera
