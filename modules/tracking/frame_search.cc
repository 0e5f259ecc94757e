#include "tracking/frame_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "core/quantile.h"
#include "geometry/absolute_pose.h"
#include "matching/frame_pose.h"
#include "measurement/image_cells.h"
#include "tracking/confirmed_points.h"
#include "tracking/local_points.h"
#include "tracking/pair_motion.h"

namespace tessera {
namespace {

// A try to follow the last frame has found the true pose if these shares of the matches, and of the last frame's
// points, agree with it. At usual steps 0.77 and 0.44 is the least that was seen (KITTI 03); walls and fences seen one
// window too far gave up to 0.66 and 0.37.
constexpr double kMinShareOfMatches = 0.5, kMinShareOfLast = 0.4;
// Or if the motion so far knew, to this standard deviation, where points are seen, and the camera turned as predicted.
// In the open, where points fade from frame to frame, no other try is better. A vehicle, whose direction of travel is
// known well, doesn't jump aside by a window of a wall: its motion need not know the image as well.
constexpr double kMaxPriorSigma_px = 2.0, kMaxTurnFromPrediction_rad = 0.01;
constexpr double kMaxDirectionSigma_rad = 0.1, kMaxVehicleSigma_px = 5.0;

// Of the confirmed points that agree with one pose, those that agree with another of the same scene.
constexpr double kMinShareOfConfirmed = 0.3;

// Before a motion is known: how many poses on which points agree are tried, and pieces of the image in a row.
constexpr int kMaxMotions = 3, kCellsAlong = 20;

// What makes the camera jump must have more than three times the points of what lets it go on, and more of the
// confirmed ones, where so many tell. What moves by less in the image goes on.
constexpr double kMinShareGoingOn = 0.3;
constexpr int kTelling = 8;
constexpr double kMaxOff_px = 10.0;

// With depth, two frames by themselves are asked only where fewer points agree: that takes ten times as long as all the
// tries, and more points are hardly wrong by chance.
constexpr int kFewWithDepth = 100;

// What the essential matrix of two frames may be off by, and a wall seen one window too far is not.
constexpr double kMaxTurnFromPair_rad = 0.035;

// How many pieces of the image hold points of the frame.
int NumCells(const TrackedFrame& frame) {
  const ImageCells cells(frame.view->calibration(), kCellsAlong);
  std::vector<char> is_held(Index(cells.num()), 0);
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Keypoint& keypoint = frame.view->features().keypoints[i];
    is_held[Index(cells.Of(keypoint.x_px, keypoint.y_px))] = 1;
  }
  return static_cast<int>(std::ranges::count(is_held, 1));
}

double TurnBetween(const Rigid3& a, const Rigid3& b) { return LogSO3(a.rotation.conjugate() * b.rotation).norm(); }

}  // namespace

Result<> FrameSearchOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(matching.Check());
  return Require(max_local_keyframes >= 1, "max_local_keyframes must be at least 1");
}

FrameSearch::FrameSearch(Frame view, const TrackedFrame& last, const ExpectedFrame& expected, const MapReplica& replica,
                         const FrameSearchOptions& options, bool by_confirmed)
    : view_(std::move(view)),
      last_(last),
      expected_(expected),
      replica_(replica),
      options_(options),
      by_confirmed_(by_confirmed) {}

std::optional<FoundFrame> FrameSearch::Follow() {
  Best best;
  bool is_clear = false;
  for (const double widening : {1.0, 2.0, 4.0}) {
    const PosePrior* prior = expected_.prior ? &*expected_.prior : nullptr;
    is_clear = is_clear || TryAt(expected_.world_from_camera, widening, prior, best);
  }
  if (!is_clear) {
    for (const FoundFrame& found : Anywhere()) is_clear |= TryAt(found.frame.world_from_camera, 1.0, nullptr, best);
  }
  const bool are_few = view_->baseline_m() == 0.0 || best.num_inliers < kFewWithDepth;
  if (!is_clear && are_few) is_clear = PoseByPair() && TryAt(*PoseByPair(), 1.0, nullptr, best);
  if (best.num_inliers < options_.min_last_matches / 2) return std::nullopt;
  const bool is_wide = (is_clear && best.num_tries > 1) || IsWide(*best.frame);
  return FoundFrame{std::move(*best.frame), is_wide, !is_clear};
}

std::optional<FoundFrame> FrameSearch::FindAnywhere() {
  return Anywhere().empty() ? std::nullopt : std::optional(Anywhere().front());
}

// At first a row of posts, seen one too far, or a lorry may have more points than the rest of the scene.
const std::vector<FoundFrame>& FrameSearch::Anywhere() {
  if (!anywhere_) anywhere_ = SearchAnywhere(knows_motion() ? 1 : kMaxMotions);
  return *anywhere_;
}

const std::optional<Rigid3>& FrameSearch::PoseByPair() {
  if (!by_pair_) by_pair_ = SearchByPair();
  return *by_pair_;
}

bool FrameSearch::PairContradicts(const Rigid3& world_from_camera) {
  if (view_->baseline_m() > 0.0) return false;
  const double turn_sigma_px = view_->calibration().fx_px * expected_.turn_sigma_rad;
  if (turn_sigma_px < options_.matching.last_radius_px || IsAsExpected(world_from_camera)) return false;
  const std::optional<Rigid3>& by_pair = PoseByPair();
  return by_pair && TurnBetween(*by_pair, world_from_camera) > kMaxTurnFromPair_rad;
}

// Whether the motion so far knew where the last frame's points are seen, and the camera turned as predicted.
bool FrameSearch::IsAsExpected(const Rigid3& world_from_camera) const {
  if (!expected_.prior) return false;
  const bool is_vehicle = expected_.way && expected_.way->sigma_rad < kMaxDirectionSigma_rad;
  return TurnBetween(expected_.world_from_camera, world_from_camera) < kMaxTurnFromPrediction_rad &&
         ExpectedSigma_px() < (is_vehicle ? kMaxVehicleSigma_px : kMaxPriorSigma_px);
}

// More points agree; but something that fills the image and moves has hardly any confirmed ones, and makes the camera
// jump. Before anything is known of the motion, the scene is what takes more of the image.
bool FrameSearch::IsBetter(const Best& one, const Best& best) const {
  if (by_confirmed_) {
    return std::pair(one.num_confirmed, one.num_inliers) > std::pair(best.num_confirmed, best.num_inliers);
  }
  const auto [fewest, most] = std::minmax(one.num_confirmed, best.num_confirmed);
  if (most >= kMinConfirmed && fewest < kMinShareOfConfirmed * most) return one.num_confirmed == most;
  if (!knows_motion()) return std::pair(one.num_cells, one.num_inliers) > std::pair(best.num_cells, best.num_inliers);
  if (one.goes_on != best.goes_on) {
    const auto& [steady, jumping] = one.goes_on ? std::tie(one, best) : std::tie(best, one);
    const bool is_confirmed = steady.num_confirmed >= std::max(kTelling, jumping.num_confirmed);
    if (is_confirmed || steady.num_inliers >= kMinShareGoingOn * jumping.num_inliers) return one.goes_on;
  }
  return one.num_inliers > best.num_inliers;
}

// Whether a camera that moved as this one did may be here.
bool FrameSearch::GoesOn(const Rigid3& world_from_camera) const {
  const double off = (world_from_camera.translation - expected_.world_from_camera.translation).norm();
  return off <= expected_.max_off || view_->calibration().fx_px * off <= kMaxOff_px * last_.MedianDepth();
}

// Whether the last frame's points, looked for around where they should be at this pose, show clearly what it is.
bool FrameSearch::TryAt(const Rigid3& world_from_camera, double widening, const PosePrior* prior, Best& best) const {
  ++best.num_tries;
  TrackedFrame frame(view_);
  frame.world_from_camera = world_from_camera;
  const int num = MatchLast(last_, widening * options_.matching.last_radius_px, options_.matching, frame);
  if (num < options_.min_last_matches) return false;
  const PoseByConfirmed pose = OptimizeByConfirmed(replica_, options_.pose, prior, frame);
  const int num_inliers = pose.optimized.num_inliers;
  const Rigid3 found = frame.world_from_camera;
  const int num_cells = knows_motion() ? 0 : NumCells(frame);
  Best one{std::move(frame), num_inliers, pose.num_confirmed, num_cells, GoesOn(found), best.num_tries};
  if (IsBetter(one, best)) best = std::move(one);
  if (num_inliers < options_.min_last_matches / 2) return false;
  if (num_inliers > kMinShareOfMatches * num && num_inliers > kMinShareOfLast * last_.NumPoints()) return true;
  return prior != nullptr && IsAsExpected(found);
}

// How well a steady motion knows where the last frame's points are seen: by its way at their depth, and its turn.
double FrameSearch::ExpectedSigma_px() const {
  const double sigma = std::sqrt(expected_.prior->information.inverse().trace() / 3.0);
  return view_->calibration().fx_px * std::hypot(sigma / last_.MedianDepth(), expected_.turn_sigma_rad);
}

bool FrameSearch::IsWide(const TrackedFrame& frame) const {
  const Rigid3 camera_from_world = expected_.world_from_camera.Inverse();
  std::vector<double> distances_px;
  for (int i = 0; i < frame.view->size(); ++i) {
    const SeenPoint& point = frame.points[Index(i)];
    if (!point.valid()) continue;
    const Eigen::Vector3d in_camera = camera_from_world * point.landmark.position_in_world;
    distances_px.push_back(
        in_camera.z() > 0.0
            ? (frame.view->calibration().Project(in_camera) - frame.view->observation(i).pixel_px).norm()
            : std::numeric_limits<double>::infinity());
  }
  return OrderStatistic(std::move(distances_px), 0.5) > options_.matching.last_radius_px;
}

std::optional<Rigid3> FrameSearch::SearchByPair() const {
  const std::optional<Rigid3> last_from_current = EstimatePairMotion(last_, *view_, expected_.way, {});
  return last_from_current ? std::optional(last_.world_from_camera * *last_from_current) : std::nullopt;
}

std::vector<FoundFrame> FrameSearch::SearchAnywhere(int max_num) const {
  KnownPoints points = LocalPoints(replica_, last_, options_.max_local_keyframes);
  for (const SeenPoint& point : last_.points) {
    if (point.valid()) points.emplace_back(point.id, point.landmark);
  }
  if (by_confirmed_) points = OnlyConfirmed(replica_, std::move(points));
  TrackedFrame matched(view_);
  MatchAnywhere(points, options_.matching, matched);
  std::vector<PointPixel> pairs;
  std::vector<int> keypoints;  // by pair
  for (int i = 0; i < view_->size(); ++i) {
    if (!matched.points[Index(i)].valid()) continue;
    const PixelObservation seen = view_->observation(i);
    pairs.push_back({matched.points[Index(i)].landmark.position_in_world, seen.pixel_px, seen.sigma_px});
    keypoints.push_back(i);
  }
  std::vector<FoundFrame> found;
  while (static_cast<int>(found.size()) < max_num) {
    const auto seed = static_cast<uint64_t>(view_->features().frame.value);
    const auto pose = EstimateAbsolutePose(view_->calibration(), pairs, seed, {});
    if (!pose) break;
    TrackedFrame frame(view_);
    frame.world_from_camera = pose->camera_from_world.Inverse();
    // Most of what descriptors alone match may be wrong, and would pull the pose away before it is told apart.
    size_t num_left = 0;
    for (size_t pair = 0; pair < pairs.size(); ++pair) {
      const int keypoint = keypoints[pair];
      if (pose->is_inlier[pair]) {
        frame.points[Index(keypoint)] = matched.points[Index(keypoint)];
      } else {
        pairs[num_left] = pairs[pair];
        keypoints[num_left++] = keypoint;
      }
    }
    pairs.resize(num_left);
    keypoints.resize(num_left);
    if (OptimizeFrame(options_.pose, frame) < options_.min_last_matches / 2) break;
    const bool is_wide = IsWide(frame);
    found.push_back({std::move(frame), is_wide, true});
  }
  return found;
}

}  // namespace tessera
