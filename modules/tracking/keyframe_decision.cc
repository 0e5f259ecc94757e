#include "tracking/keyframe_decision.h"

#include <algorithm>
#include <cmath>

#include "core/quantile.h"
#include "geometry/triangulation.h"
#include "measurement/landmark_description.h"

namespace tessera {
namespace {

// Far points stay in view for long, and tell nothing about how much of what is near has gone.
bool IsKnown(const SeenPoint& point, const TrackedFrame& frame) {
  return point.valid() && HasDepth(point.landmark, frame.world_from_camera.translation);
}

}  // namespace

Result<> KeyframeDecisionOptions::Check() const {
  for (const double share : {min_share, min_share_with_depth, min_first_share, min_still_share}) {
    if (!(share > 0.0 && share < 1.0)) return Failed("the shares of a reference's points must be between 0 and 1");
  }
  if (!(max_turn_share > 0.0)) return Failed("max_turn_share must be positive");
  if (!(min_parallax_rad > 0.0) || max_interval_us < 1) return Failed("the limits of keyframes must be positive");
  return {};
}

void KeyframeDecision::Restart(const TrackedFrame& frame) {
  utime_us_ = frame.view->features().utime_us;
  first_utime_us_.reset();
  points_.clear();
  for (const SeenPoint& point : frame.points) {
    if (IsKnown(point, frame)) points_.push_back(point.id);
  }
  std::sort(points_.begin(), points_.end());
}

void KeyframeDecision::Renew(const MapReplica& replica) {
  for (PointId& point : points_) point = replica.Renew(point);
  std::erase_if(points_, [](const PointId& point) { return !point.valid(); });
  if (!std::is_sorted(points_.begin(), points_.end())) std::sort(points_.begin(), points_.end());
}

KeyframeDecision::Seen KeyframeDecision::See(const TrackedFrame& frame, const Rigid3& world_from_reference) const {
  Seen seen;
  std::vector<double> cosines;
  for (const SeenPoint& point : frame.points) {
    if (!IsKnown(point, frame) || !std::binary_search(points_.begin(), points_.end(), point.id)) continue;
    seen.points.push_back(point.id);
    cosines.push_back(CosParallax(point.landmark.position_in_world, world_from_reference.translation,
                                  frame.world_from_camera.translation));
  }
  if (!cosines.empty())
    seen.median_parallax_rad = std::acos(std::clamp(OrderStatistic(std::move(cosines), 0.5), -1.0, 1.0));
  return seen;
}

// What is seen falls about linearly from the frame after the reference: share(t) = 1 - slope (t - first), taken one
// frame ahead.
double KeyframeDecision::NextShare(double share, int64_t utime_us, int64_t frame_interval_us) const {
  const auto elapsed_us = static_cast<double>(std::max<int64_t>(1, utime_us - *first_utime_us_));
  return share - (1.0 - share) * std::min(1.0, static_cast<double>(frame_interval_us) / elapsed_us);
}

// The turn since the reference, taken one frame ahead.
bool KeyframeDecision::TurnsAway(const TrackedFrame& frame, const Rigid3& world_from_reference,
                                 int64_t frame_interval_us) const {
  const CameraCalibration& camera = frame.view->calibration();
  const double field_of_view_rad = 2.0 * std::atan(0.5 * camera.width_px / camera.fx_px);
  const double turn_rad = LogSO3(world_from_reference.rotation.conjugate() * frame.world_from_camera.rotation).norm();
  const auto elapsed_us = static_cast<double>(std::max<int64_t>(1, frame.view->features().utime_us - utime_us_));
  const double ahead = std::min(1.0, static_cast<double>(frame_interval_us) / elapsed_us);
  return turn_rad * (1.0 + ahead) > options_.max_turn_share * field_of_view_rad;
}

bool KeyframeDecision::Decide(const TrackedFrame& frame, int64_t frame_interval_us, const Rigid3& world_from_reference,
                              const NearKeypoints& near) {
  Seen seen = See(frame, world_from_reference);
  if (seen.points.empty()) return true;
  const int64_t utime_us = frame.view->features().utime_us;
  const double share = static_cast<double>(seen.points.size()) / static_cast<double>(points_.size());
  const bool is_first = !first_utime_us_;
  if (is_first) {
    first_utime_us_ = utime_us;
    points_ = std::move(seen.points);
    std::sort(points_.begin(), points_.end());
  }
  const double min_share = frame.view->baseline_m() > 0.0 ? options_.min_share_with_depth : options_.min_share;
  const bool has_lost_sight =
      is_first ? share < options_.min_first_share : NextShare(share, utime_us, frame_interval_us) < min_share;
  const bool lacks_near = near.num_known < options_.max_known_points && near.num_new > options_.min_new_points;
  const bool has_moved = share < options_.min_still_share;
  const bool is_old = utime_us - utime_us_ > options_.max_interval_us;
  const bool lacks_points = frame.NumPoints() < options_.min_points;
  const bool has_parallax = frame.view->baseline_m() == 0.0 && seen.median_parallax_rad > options_.min_parallax_rad;
  const bool turns_away = TurnsAway(frame, world_from_reference, frame_interval_us);
  return has_lost_sight || turns_away || lacks_near || (has_moved && (is_old || lacks_points || has_parallax));
}

}  // namespace tessera
