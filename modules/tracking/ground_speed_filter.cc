#include "tracking/ground_speed_filter.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tessera {
namespace {

constexpr double kLeak = 0.001;
constexpr double kWalk = 0.1;          // of the logarithm, in a second
constexpr double kAcceleration = 1.5;  // heights/s^2: what it matters at low speeds
constexpr double kMinSpeed = 0.3;      // heights/s; slower, speeds are uncertain by their own size anyway
constexpr double kMaxWalk = 0.2;       // of the logarithm, in a second, that a vehicle can follow; and heights/s^2
constexpr double kMaxAcceleration = 2.5;
constexpr double kMaxBehind = 0.2;

double SpeedAt(double log_speed) { return std::exp(std::clamp(log_speed, 0.0, 4.0)); }

}  // namespace

void GroundSpeedFilter::Predict(double interval_s) {
  const double acceleration = kAcceleration * interval_s / std::max(std::exp(std::min(log_speed_, 4.0)), kMinSpeed);
  const double sigma = std::hypot(kWalk * std::sqrt(interval_s), acceleration) / kGroundSpeedStep;
  const int reach = std::min(kNumGroundSpeeds, static_cast<int>(std::ceil(3.0 * sigma)));
  std::vector<double> kernel(static_cast<size_t>(reach) + 1);
  double total = 0.0;
  for (int i = 0; i <= reach; ++i) {
    const double weight = std::exp(-0.5 * i * i / (sigma * sigma));
    kernel[static_cast<size_t>(i)] = weight;
    total += i == 0 ? weight : 2.0 * weight;
  }
  GroundSpeeds next{};
  for (int i = 0; i < kNumGroundSpeeds; ++i) {
    const double share = belief_[static_cast<size_t>(i)] / total;
    for (int j = std::max(0, i - reach); j <= std::min(kNumGroundSpeeds - 1, i + reach); ++j) {
      next[static_cast<size_t>(j)] += share * kernel[static_cast<size_t>(std::abs(i - j))];
    }
  }
  for (double& value : next) value = (1.0 - kLeak) * value + kLeak / kNumGroundSpeeds;
  belief_ = next;
}

void GroundSpeedFilter::Update(const GroundSpeeds& log_likelihood, double max_evidence) {
  const double best = *std::ranges::max_element(log_likelihood);
  for (size_t i = 0; i < belief_.size(); ++i) {
    belief_[i] *= std::exp(std::max(log_likelihood[i] - best, -max_evidence));
  }
}

void GroundSpeedFilter::Add(const std::optional<GroundSpeeds>& log_likelihood, double interval_s, double max_evidence) {
  Predict(interval_s);
  if (log_likelihood) Update(*log_likelihood, max_evidence);
  Describe();
  const double limit = interval_s * (kMaxWalk + kMaxAcceleration / SpeedAt(followed_));
  followed_ += std::clamp(log_speed_ - followed_, -limit, limit);
}

bool GroundSpeedFilter::is_plausible() const { return std::abs(log_speed_ - followed_) < kMaxBehind; }

// Makes the belief one of 1 in all, and sets its mean and standard deviation.
void GroundSpeedFilter::Describe() {
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (const double value : belief_) sum += value;
  for (int i = 0; i < kNumGroundSpeeds; ++i) {
    double& value = belief_[static_cast<size_t>(i)];
    value /= sum;
    mean += value * i;
    square += value * i * i;
  }
  log_speed_ = std::log(kMinGroundSpeed) + kGroundSpeedStep * (mean + 0.5);
  sigma_ = kGroundSpeedStep * std::sqrt(std::max(square - mean * mean, 0.0));
}

}  // namespace tessera
