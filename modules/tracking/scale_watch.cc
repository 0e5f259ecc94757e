#include "tracking/scale_watch.h"

#include <cmath>

namespace tessera {

void ScaleWatch::Add(int64_t utime_us, const Eigen::Vector3d& step, const Eigen::Matrix3d& covariance) {
  const double squared = step.squaredNorm();
  const double variance = step.dot(covariance * step) / (squared * squared);
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
