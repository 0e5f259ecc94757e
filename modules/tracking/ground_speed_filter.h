// The speed of a camera over the ground from frame to frame, by what single steps say of it.
#pragma once

#include <optional>

#include "matching/ground_speed.h"

namespace tessera {

// A Bayes filter over the speeds of matching/ground_speed.h. From step to step, the logarithm of the speed changes by a
// random walk, as vehicles accelerate, and with kLeak by anything:
//
//   p(s | steps so far) ~ L(s) integral p(s') ((1 - kLeak) N(log s - log s'; walk) + kLeak / range) ds'
//
// A texture that repeats itself has several answers, and the ground bends: one step may move the belief by a factor of
// exp(kMaxEvidence) at most, so that a wrong answer must be given again and again before it counts.
class GroundSpeedFilter {
 public:
  static constexpr double kMaxEvidence = 2.0;

  GroundSpeedFilter() { belief_.fill(1.0 / kNumGroundSpeeds); }

  // A step of `interval_s` > 0, and what it says of its speed; nullopt: nothing.
  void Add(const std::optional<GroundSpeeds>& log_likelihood, double interval_s, double max_evidence = kMaxEvidence);

  double log_speed() const { return log_speed_; }  // heights/s: the mean of its logarithm
  double sigma() const { return sigma_; }          // standard deviation of that
  // No vehicle brakes or accelerates like that: the ground ahead falls away or rises.
  bool is_plausible() const;

 private:
  void Predict(double interval_s);
  void Update(const GroundSpeeds& log_likelihood, double max_evidence);
  void Describe();

  GroundSpeeds belief_{};
  double log_speed_ = 0.0;
  double sigma_ = 2.0;
  double followed_ = 0.0;  // log_speed_ as a vehicle could follow it
};

}  // namespace tessera
