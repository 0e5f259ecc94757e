#include "tracking/lost_way.h"

#include <algorithm>
#include <utility>

#include "core/time_units.h"

namespace tessera {
namespace {

constexpr size_t kMaxPoses = 200;      // remembered: more than the start of a part looks back
constexpr double kTurnMemory_s = 1.0;  // for so long a camera turns on as it did, unseen
constexpr double kMaxFar_px = 2.0;     // of a keypoint that moved by the turn alone
// From frame to frame a camera turns about alike: what a few false pairs say, in the worst case, doesn't.
constexpr double kMaxChange_rad = 0.1, kMaxChangeShare = 0.5;

// How many pairs moved as what is far away does. `turn`: second_from_first.
size_t NumFar(const CameraCalibration& camera, const std::vector<PixelPair>& pairs, const Eigen::Quaterniond& turn) {
  size_t num_far = 0;
  for (const PixelPair& pair : pairs) {
    const Eigen::Vector3d ray = turn * camera.Ray(pair.first_px);
    num_far += ray.z() > 0.0 && (camera.Project(ray) - pair.second_px).norm() < kMaxFar_px ? 1U : 0U;
  }
  return num_far;
}

}  // namespace

void LostWay::Begin(Frame last, const Rigid3& world_from_last, const Eigen::Vector3d& velocity,
                    const Eigen::Vector3d& turn_rate) {
  poses_ = {{last->features().utime_us, world_from_last}};
  anchor_ = std::move(last);
  world_from_anchor_ = world_from_last.rotation;
  velocity_ = velocity;
  turn_rate_ = turn_rate;
}

void LostWay::Add(const Frame& view) {
  const PoseAtTime before = poses_.back();
  const int64_t utime_us = view->features().utime_us;
  const double interval_s = SecondsOf(utime_us - before.utime_us);
  if (interval_s <= 0.0) return;
  const Eigen::Quaterniond& world_from_before = before.world_from_camera.rotation;
  const Eigen::Quaterniond expected = ExpSO3(turn_rate_ * interval_s);
  const Eigen::Quaterniond anchor_from_expected = world_from_anchor_.conjugate() * world_from_before * expected;
  const std::optional<Eigen::Quaterniond> seen = TurnTo(*view, anchor_from_expected);
  const Eigen::Quaterniond world_from_camera = (world_from_anchor_ * seen.value_or(anchor_from_expected)).normalized();
  const Eigen::Quaterniond before_from_camera = world_from_before.conjugate() * world_from_camera;
  turn_rate_ =
      seen ? Eigen::Vector3d(LogSO3(before_from_camera) / interval_s) : turn_rate_ / (1.0 + interval_s / kTurnMemory_s);
  // Half of the turn is done in the middle of the step.
  const Eigen::Vector3d way = Eigen::Quaterniond::Identity().slerp(0.5, before_from_camera) * velocity_ * interval_s;
  if (poses_.size() == kMaxPoses) poses_.erase(poses_.begin());
  poses_.push_back({utime_us, before.world_from_camera * Rigid3{before_from_camera, way}});
  if (seen && seen->isApprox(Eigen::Quaterniond::Identity())) return;  // a slow turn shows after several frames
  anchor_ = view;
  world_from_anchor_ = world_from_camera;
}

Rigid3 LostWay::PoseAt(int64_t utime_us) const {
  if (poses_.empty()) return {};
  const auto later = std::ranges::upper_bound(poses_, utime_us, {}, &PoseAtTime::utime_us);
  return later == poses_.begin() ? poses_.front().world_from_camera : std::prev(later)->world_from_camera;
}

// anchor_from_view; nullopt: the frames don't show it. Where most of what they see didn't move, the camera did not
// turn.
std::optional<Eigen::Quaterniond> LostWay::TurnTo(const FrameView& view, const Eigen::Quaterniond& expected) const {
  const CameraCalibration& camera = view.calibration();
  std::vector<Eigen::Vector2d> centers_px;
  for (int i = 0; i < anchor_->size(); ++i) {
    const Eigen::Vector3d ray = expected.conjugate() * camera.Ray(anchor_->pixel(i));
    centers_px.push_back(ray.z() > 0.0 ? camera.Project(ray) : Eigen::Vector2d(-camera.width_px, -camera.height_px));
  }
  std::vector<PixelPair> pairs;
  for (const Match& match :
       MatchInWindow(*anchor_, centers_px, view, options_.radius_share * camera.longer_side_px(), options_.matching)) {
    pairs.push_back({anchor_->pixel(match.first), view.pixel(match.second)});
  }
  if (2 * NumFar(camera, pairs, Eigen::Quaterniond::Identity()) > pairs.size()) return Eigen::Quaterniond::Identity();
  TwoViewOptions two_view = options_.two_view;
  std::vector<Rigid3> guesses;
  if (speed() > 0.0) {
    two_view.prior = DirectionPrior{velocity_, options_.direction_sigma_rad};
    guesses.push_back({expected.conjugate(), two_view.prior->DirectionFor(expected.conjugate())});
  }
  const auto seed = static_cast<uint64_t>(view.features().frame.value);
  const std::optional<TwoViewResult> motion = EstimateTwoView(camera, pairs, seed, two_view, guesses);
  if (!motion) return std::nullopt;
  const Eigen::Quaterniond& turn = motion->second_from_first.rotation;
  const bool is_seen = motion->num_points >= two_view.min_points || 2 * NumFar(camera, pairs, turn) > pairs.size();
  const double change_rad = turn.angularDistance(expected.conjugate());
  const double max_change_rad = kMaxChange_rad + kMaxChangeShare * LogSO3(expected).norm();
  return is_seen && change_rad < max_change_rad ? std::optional(turn.conjugate()) : std::nullopt;
}

}  // namespace tessera
