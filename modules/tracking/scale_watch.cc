#include "tracking/scale_watch.h"

#include <cmath>

namespace tessera {
namespace {

constexpr double kOpenSigma = 0.2;  // of the logarithm
constexpr double kMinKnownShare = 0.5;

}  // namespace

void ScaleWatch::Add(KeyframeId keyframe, int64_t utime_us, const Eigen::Vector3d& step,
                     const Eigen::Matrix3d& covariance, double known_share) {
  const double squared = step.squaredNorm();
  const double variance = step.dot(covariance * step) / (squared * squared);
  const bool is_open = !std::isfinite(variance) || variance > kOpenSigma * kOpenSigma;
  if (is_open && known_share >= kMinKnownShare && since_.valid()) return;
  since_ = keyframe;
  if (!std::isfinite(variance) || variance <= 0.0) return;
  variance_ += variance;
  recent_.push_back({utime_us, variance});
  while (utime_us - recent_.front().utime_us > kRecent_us) recent_.pop_front();
}

double ScaleWatch::drift() const { return std::sqrt(variance_); }

double ScaleWatch::RecentDrift(int64_t utime_us) const {
  double variance = 0.0;
  for (const Step& step : recent_) {
    if (utime_us - step.utime_us <= kRecent_us) variance += step.variance;
  }
  return std::sqrt(variance);
}

}  // namespace tessera
