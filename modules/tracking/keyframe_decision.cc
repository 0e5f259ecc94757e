#include "tracking/keyframe_decision.h"

#include <algorithm>
#include <cmath>

#include "geometry/triangulation.h"

namespace tessera {
namespace {

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::string KeyframeDecisionOptions::Check() const {
  if (!(min_share > 0.0 && min_share < 1.0)) return "tracker.min_reference_share must be between 0 and 1";
  if (!(min_parallax_rad > 0.0) || max_interval_us < 1) return "the limits of keyframes must be positive";
  return "";
}

void KeyframeDecision::Restart(const TrackedFrame& frame) {
  utime_us_ = frame.view->features().utime_us;
  points_.clear();
  for (const SeenPoint& point : frame.points) {
    if (point.valid()) points_.push_back(point.id);
  }
  std::sort(points_.begin(), points_.end());
}

void KeyframeDecision::Renew(const MapReplica& replica) {
  for (PointId& point : points_) point = replica.Renew(point);
  std::erase_if(points_, [](const PointId& point) { return !point.valid(); });
  std::sort(points_.begin(), points_.end());
}

bool KeyframeDecision::Decide(const TrackedFrame& frame, int64_t frame_interval_us,
                              const Rigid3& world_from_reference, int num_near_known, int num_near_new) const {
  std::vector<double> cosines;
  for (const SeenPoint& point : frame.points) {
    if (!point.valid() || !std::binary_search(points_.begin(), points_.end(), point.id)) continue;
    cosines.push_back(CosParallax(point.landmark.position_in_world, world_from_reference.translation,
                                  frame.world_from_camera.translation));
  }
  if (cosines.empty() || points_.empty()) return true;
  const double share = static_cast<double>(cosines.size()) / static_cast<double>(points_.size());
  const double elapsed_us = static_cast<double>(std::max<int64_t>(1, frame.view->features().utime_us - utime_us_));
  // What is seen falls about linearly: share(t) = 1 - (1 - share) t / elapsed, taken one frame ahead.
  const double next_share = share - (1.0 - share) * static_cast<double>(frame_interval_us) / elapsed_us;
  const double parallax_rad = std::acos(std::clamp(Median(cosines), -1.0, 1.0));
  const bool lacks_near = num_near_known < options_.max_known_points && num_near_new > options_.min_new_points;
  const bool is_old = elapsed_us > static_cast<double>(options_.max_interval_us) && share < options_.min_still_share;
  const bool lacks_points = frame.NumPoints() < options_.min_points && share < options_.min_still_share;
  return lacks_points || next_share < options_.min_share || lacks_near || is_old ||
         (parallax_rad > options_.min_parallax_rad && share < options_.min_still_share);
}

}  // namespace tessera
