#include "tracking/lost_way.h"

#include <algorithm>
#include <utility>

#include "core/time_units.h"

namespace tessera {
namespace {

constexpr size_t kMaxPoses = 200;      // remembered: more than the start of a part looks back
constexpr double kTurnMemory_s = 1.0;  // for so long a camera turns on as it did, unseen

}  // namespace

void LostWay::Begin(Frame last, const Rigid3& world_from_last, const Eigen::Vector3d& velocity,
                    const Eigen::Vector3d& turn_rate) {
  poses_ = {{last->features().utime_us, world_from_last}};
  last_ = std::move(last);
  velocity_ = velocity;
  turn_rate_ = turn_rate;
}

void LostWay::Add(const Frame& view) {
  const PoseAtTime before = poses_.back();
  const int64_t utime_us = view->features().utime_us;
  const double interval_s = SecondsOf(utime_us - before.utime_us);
  if (interval_s <= 0.0) return;
  const Eigen::Quaterniond expected = ExpSO3(turn_rate_ * interval_s);
  const std::optional<Eigen::Quaterniond> seen = TurnTo(*view, expected);
  const Eigen::Quaterniond last_from_current = seen.value_or(expected);
  turn_rate_ = seen ? Eigen::Vector3d(LogSO3(*seen) / interval_s) : turn_rate_ / (1.0 + interval_s / kTurnMemory_s);
  // Half of the turn is done in the middle of the step.
  const Eigen::Vector3d way = Eigen::Quaterniond::Identity().slerp(0.5, last_from_current) * velocity_ * interval_s;
  if (poses_.size() == kMaxPoses) poses_.erase(poses_.begin());
  poses_.push_back({utime_us, before.world_from_camera * Rigid3{last_from_current, way}});
  last_ = view;
}

Rigid3 LostWay::PoseAt(int64_t utime_us) const {
  if (poses_.empty()) return {};
  const auto later = std::ranges::upper_bound(poses_, utime_us, {}, &PoseAtTime::utime_us);
  return later == poses_.begin() ? poses_.front().world_from_camera : std::prev(later)->world_from_camera;
}

// last_from_current by what both frames see far away.
std::optional<Eigen::Quaterniond> LostWay::TurnTo(const FrameView& view, const Eigen::Quaterniond& expected) const {
  const CameraCalibration& camera = view.calibration();
  std::vector<Eigen::Vector2d> centers_px;
  for (int i = 0; i < last_->size(); ++i) {
    const Eigen::Vector3d ray = expected.conjugate() * camera.Ray(last_->pixel(i));
    centers_px.push_back(ray.z() > 0.0 ? camera.Project(ray) : Eigen::Vector2d(-camera.width_px, -camera.height_px));
  }
  std::vector<PixelPair> pairs;
  for (const Match& match :
       MatchInWindow(*last_, centers_px, view, options_.radius_share * camera.width_px, options_.matching)) {
    pairs.push_back({last_->pixel(match.first), view.pixel(match.second)});
  }
  TwoViewOptions two_view = options_.two_view;
  std::vector<Rigid3> guesses;
  if (speed() > 0.0) {
    two_view.prior = DirectionPrior{velocity_, options_.direction_sigma_rad};
    guesses.push_back({expected.conjugate(), two_view.prior->DirectionFor(expected.conjugate())});
  }
  const auto seed = static_cast<uint64_t>(view.features().frame.value);
  const std::optional<TwoViewResult> motion = EstimateTwoView(camera, pairs, seed, two_view, guesses);
  // DEBUG
  if (!motion || motion->num_points < two_view.min_points) return std::nullopt;
  return motion->second_from_first.rotation.conjugate();
}

}  // namespace tessera
