#include "tracking/moving_things.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/quantile.h"
#include "core/time_units.h"
#include "features/erase_keypoints.h"
#include "geometry/absolute_pose.h"
#include "matching/matching.h"
#include "measurement/feature_grid.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {
namespace {

constexpr int kCellsAlong = 40;          // the image
constexpr double kWindowShare = 0.035;   // of the longer side: a mark is looked for so far from where it is expected
constexpr int64_t kMaxAge_us = 300'000;  // of marks
constexpr int64_t kTellingAge_us = 120'000;  // what agrees with the scene's motion for so long stands still
constexpr int kMinSeen = 40, kFewSeen = 60;  // marks: fewer tell nothing; new ones are due
constexpr double kMinShareSeen = 0.5;        // of the most that a frame showed of these marks
constexpr int kMinGroup = 12;                // marks on one thing that moves
constexpr int kMaxMotions = 6;
constexpr double kFarthest = 5.0;            // times the median depth: what is farther counts as if it were there
constexpr double kMaxMiss = 3.0;             // standard deviations: what misses by more is not explained
constexpr double kOff = 6.0;                 // the same: it is clearly elsewhere
constexpr double kGoesOn = 3.0;              // times the surface, of a motion that goes on
constexpr double kAcceleration_mps2 = 10.0;  // of a camera of which nothing more is known
constexpr double kReadout_s = 0.03;          // of a rolling shutter, from the first row to the last
constexpr double kMaxBend_px = 10.0;
constexpr double kStill_px = 2.0;    // from frame to frame
constexpr double kSameDepth = 0.15;  // share

// The point of a keypoint with depth, and its standard deviation along the line of sight: that of the disparity d is
// that of z by the share sigma_d / d.
struct MeasuredPoint {
  Eigen::Vector3d point, depth_sigma;
};
std::optional<MeasuredPoint> Measure(const FeatureFrame& features, int32_t keypoint) {
  constexpr double kMaxShare = 0.5;
  const std::optional<Eigen::Vector3d> point = PointFromDepth(features, keypoint);
  if (!point) return std::nullopt;
  const CameraCalibration& camera = features.calibration;
  const double sigma_px =
      camera.sensor == SensorType::kRgbd ? kRgbdDisparitySigmaPx : SeenAt(features, keypoint).sigma_px;
  const double share = std::min(kMaxShare, sigma_px * point->z() / (camera.fx_px * Baseline(camera)));
  return MeasuredPoint{*point, share * *point};
}

Eigen::Vector3d CenterOf(const Rigid3& camera_from_world) { return camera_from_world.Inverse().translation; }

}  // namespace

void MovingThings::Add(const FeatureFrame& features, const std::optional<ExpectedMotion>& expected) {
  if (features.calibration != camera_) Restart(features.calibration);
  if (Baseline(camera_) == 0.0) return;
  const double interval_s = SecondsOf(features.utime_us - last_us_);
  const Rigid3 current_from_last = expected ? expected->last_from_current.Inverse() : step_;
  const double any_off_m = kAcceleration_mps2 * interval_s * interval_s;
  const double max_off_m = expected ? expected->max_off_m.value_or(any_off_m) : any_off_m;
  const Rigid3 current_from_marked = current_from_last * last_from_marked_;
  FollowMarks(features, current_from_marked);
  last_us_ = features.utime_us;
  const int64_t age_us = features.utime_us - marked_us_;
  std::vector<PoseObservation> observations = Observe(features);
  const auto num_seen = static_cast<int>(observations.size());
  if (num_seen >= kMinSeen && interval_s > 0.0) {
    const auto seed = static_cast<uint64_t>(features.frame.value);
    const std::vector<Motion> motions = FindMotions(observations, seed, current_from_marked, max_off_m);
    step_ = motions.front().current_from_marked * last_from_marked_.Inverse();
    last_turn_ = LogSO3(step_.rotation) / interval_s;
    last_from_marked_ = motions.front().current_from_marked;
    LabelMarks(observations, motions, age_us);
  } else {
    step_ = Rigid3();
    last_turn_.setZero();
  }
  KeepLabels(features);
  most_seen_ = std::max(most_seen_, num_seen);
  if (age_us >= kMaxAge_us || num_seen < std::max<double>(kFewSeen, kMinShareSeen * most_seen_)) SetMarks(features);
}

FeatureFrame MovingThings::Without(FeatureFrame features) const {
  if (num_moving_ == 0) return features;
  EraseKeypoints(features, [&](size_t i) { return Covers(features, static_cast<int32_t>(i)); });
  return features;
}

bool MovingThings::any_goes() const { return num_going_ >= kMinGroup; }

void MovingThings::Restart(const CameraCalibration& camera) {
  *this = {};
  camera_ = camera;
  grid_ = ImageCells(camera, kCellsAlong);
}

// The strongest keypoint with depth of each piece of the image. What was on something that moves is so until it shows
// that it stands still.
void MovingThings::SetMarks(const FeatureFrame& features) {
  std::vector<int32_t> strongest(Index(grid_.num()), -1);
  const auto score_of = [&](int32_t i) { return static_cast<int>(features.keypoints[Index(i)].score); };
  for (int32_t i = 0; i < std::ssize(features.keypoints); ++i) {
    if (!SeenAt(features, i).has_right()) continue;
    const Keypoint& keypoint = features.keypoints[Index(i)];
    int32_t& kept = strongest[Index(grid_.Of(keypoint.x_px, keypoint.y_px))];
    if (kept < 0 || score_of(i) > score_of(kept)) kept = i;
  }
  marks_.clear();
  for (const int32_t i : strongest) {
    const std::optional<MeasuredPoint> measured = i < 0 ? std::nullopt : Measure(features, i);
    if (!measured) continue;
    const bool is_moving = Covers(features, i);
    marks_.push_back({.point = measured->point,
                      .depth_sigma = measured->depth_sigma,
                      .descriptor = features.descriptors[Index(i)],
                      .level = features.keypoints[Index(i)].level,
                      .pixel_px = SeenAt(features, i).pixel_px,
                      .keypoint = i,
                      .is_of_scene = !is_moving,
                      .is_moving = is_moving});
  }
  marked_us_ = features.utime_us;
  marked_turn_ = last_turn_;
  last_from_marked_ = Rigid3();
  most_seen_ = 0;
}

// Each is looked for around where the scene's expected motion puts it, or where its own leads. A keypoint is given to
// the mark that looks most like it.
void MovingThings::FollowMarks(const FeatureFrame& features, const Rigid3& expected) {
  const FeatureGrid grid(features.keypoints, camera_.width_px, camera_.height_px);
  const double radius_px = kWindowShare * camera_.longer_side_px();
  std::vector<Match> matches;
  for (size_t i = 0; i < marks_.size(); ++i) {
    Mark& mark = marks_[i];
    mark.keypoint = -1;
    Eigen::Vector2d at_px = mark.pixel_px + mark.step_px;
    const Eigen::Vector3d in_camera = expected * mark.point;
    if (mark.is_of_scene && in_camera.z() > 0.0) at_px = camera_.Project(in_camera);
    BestMatch best;
    const auto levels = PatchRange::Levels(mark.level - 1, mark.level + 1);
    grid.VisitWindow(at_px, radius_px, levels, [&](const PlacedKeypoint& placed) {
      best.Offer(placed.index, HammingDistance(features.descriptors[Index(placed.index)], mark.descriptor));
    });
    if (best.IsClear({})) matches.push_back({static_cast<int32_t>(i), best.index, best.distance});
  }
  const auto num_keypoints = static_cast<int>(features.keypoints.size());
  for (const Match& match : KeepBestPerSecond(std::move(matches), num_keypoints)) {
    Mark& mark = marks_[Index(match.first)];
    const Eigen::Vector2d pixel_px = SeenAt(features, match.second).pixel_px;
    mark.keypoint = match.second;
    mark.step_px = pixel_px - mark.pixel_px;
    mark.pixel_px = pixel_px;
    mark.descriptor = features.descriptors[Index(match.second)];
  }
}

std::vector<PoseObservation> MovingThings::Observe(const FeatureFrame& features) const {
  std::vector<PoseObservation> observations;
  for (const Mark& mark : marks_) {
    if (mark.keypoint >= 0) observations.push_back({mark.point, mark.depth_sigma, SeenAt(features, mark.keypoint)});
  }
  return observations;
}

// By all marks, and by those that agree with the farther half of them: before a wall, a turn and a step aside look
// nearly alike, so that the wall's marks agree with how someone in front of it moves. If one of these explains all but
// a few, that is all.
std::vector<MovingThings::Motion> MovingThings::FindMotions(std::vector<PoseObservation>& observations, uint64_t seed,
                                                            const Rigid3& expected, double max_off_m) const {
  std::vector<double> depths_m;
  for (const PoseObservation& observation : observations) depths_m.push_back(observation.point_in_world.z());
  const double median_m = OrderStatistic(depths_m, 0.5);
  std::vector<Motion> motions;
  const auto offer = [&](Motion motion) {
    motion.surfaces = SurfacesOf(motion, observations, kFarthest * median_m);
    const double off_m = (CenterOf(motion.current_from_marked) - CenterOf(expected)).norm();
    motion.goes_on = off_m <= max_off_m;
    const bool is_best = motions.empty() || ExplainsMore(motion, motions.front());
    motions.insert(is_best ? motions.begin() : motions.end(), std::move(motion));
  };
  std::vector<char> is_far;
  for (const double depth_m : depths_m) is_far.push_back(depth_m > median_m ? 1 : 0);
  offer(MotionBy({}, expected, observations));
  const Motion by_far = MotionBy(is_far, expected, observations);
  offer(MotionBy(by_far.agrees, by_far.current_from_marked, observations));
  if (std::ranges::count(AreOff(observations, motions.front().current_from_marked), 1) < kMinGroup) return motions;

  std::vector<size_t> left(observations.size());  // on which no motion has been found yet
  for (size_t i = 0; i < left.size(); ++i) left[i] = i;
  while (static_cast<int>(motions.size()) < kMaxMotions) {
    std::vector<PointPixel> pairs;
    for (const size_t i : left) {
      const PoseObservation& observation = observations[i];
      pairs.push_back({observation.point_in_world, observation.seen.pixel_px, observation.seen.sigma_px});
    }
    const auto found = EstimateAbsolutePose(camera_, pairs, seed, {.min_inliers = kMinGroup});
    if (!found) break;
    std::vector<char> votes(observations.size());
    for (size_t k = 0; k < left.size(); ++k) votes[left[k]] = found->is_inlier[k];
    Motion motion = MotionBy(votes, found->camera_from_world, observations);
    const auto num_taken = std::erase_if(left, [&](size_t i) { return motion.agrees[i] != 0 || votes[i] != 0; });
    if (num_taken < Index(kMinGroup)) break;
    offer(std::move(motion));
  }
  return motions;
}

// Where they differ.
bool MovingThings::ExplainsMore(const Motion& one, const Motion& other) {
  double by_one = 0.0, by_other = 0.0;
  for (size_t i = 0; i < one.surfaces.size(); ++i) {
    const double more = one.surfaces[i] - other.surfaces[i];
    (more > 0.0 ? by_one : by_other) += std::abs(more);
  }
  return by_one * (one.goes_on ? kGoesOn : 1.0) > by_other * (other.goes_on ? kGoesOn : 1.0);
}

MovingThings::Motion MovingThings::MotionBy(std::span<const char> votes, const Rigid3& guess,
                                            std::vector<PoseObservation>& observations) const {
  for (size_t i = 0; i < observations.size(); ++i) observations[i].votes = votes.empty() || votes[i] != 0;
  PoseOptimizationResult pose = OptimizePose(camera_, Baseline(camera_), observations, guess, {});
  return {pose.camera_from_world, std::move(pose.is_inlier)};
}

// z^2 max(0, 1 - (miss / kMaxMiss)^2)
std::vector<double> MovingThings::SurfacesOf(const Motion& motion, const std::vector<PoseObservation>& observations,
                                             double max_depth_m) const {
  std::vector<double> surfaces;
  for (const PoseObservation& observation : observations) {
    const double depth_m = std::min(observation.point_in_world.z(), max_depth_m);
    const double miss = MissOf(observation, motion.current_from_marked) / kMaxMiss;
    surfaces.push_back(depth_m * depth_m * std::max(0.0, 1.0 - miss * miss));
  }
  return surfaces;
}

// A point whose depth is known to sigma_z is seen, by a camera that has gone by t, within f |t| sigma_z / z^2.
double MovingThings::MissOf(const PoseObservation& observation, const Rigid3& current_from_marked) const {
  const Eigen::Vector3d in_camera = current_from_marked * observation.point_in_world;
  if (in_camera.z() <= 0.0) return std::numeric_limits<double>::infinity();
  const double by_depth_px = camera_.fx_px * current_from_marked.translation.norm() *
                             observation.depth_sigma_in_world.norm() / (in_camera.z() * in_camera.z());
  const double miss_px = (camera_.Project(in_camera) - observation.seen.pixel_px).norm();
  return miss_px / std::hypot(observation.seen.sigma_px, by_depth_px);
}

// Where a shutter rolls, the image bends as the turn changes: by half of its readout times that change at the top and
// at the bottom.
std::vector<char> MovingThings::AreOff(const std::vector<PoseObservation>& observations,
                                       const Rigid3& current_from_marked) const {
  const double bend_px = std::min(kMaxBend_px, 0.5 * kReadout_s * camera_.fx_px * (last_turn_ - marked_turn_).norm());
  std::vector<char> are_off;
  for (const PoseObservation& observation : observations) {
    const double max_miss = kOff + bend_px / observation.seen.sigma_px;
    are_off.push_back(MissOf(observation, current_from_marked) > max_miss ? 1 : 0);
  }
  return are_off;
}

void MovingThings::LabelMarks(const std::vector<PoseObservation>& observations, const std::vector<Motion>& motions,
                              int64_t age_us) {
  const Motion& scene = motions.front();
  const std::vector<char> are_off = AreOff(observations, scene.current_from_marked);
  std::vector<char> move(observations.size());
  for (const Motion& motion : std::span(motions).subspan(1)) {
    std::vector<size_t> group;
    for (size_t i = 0; i < observations.size(); ++i) {
      if (are_off[i] != 0 && motion.agrees[i] != 0) group.push_back(i);
    }
    if (static_cast<int>(group.size()) < kMinGroup) continue;
    for (const size_t i : group) move[i] = 1;
  }
  size_t i = 0;
  for (Mark& mark : marks_) {
    if (mark.keypoint < 0) continue;
    mark.is_of_scene = are_off[i] == 0;
    mark.is_moving |= move[i] != 0;
    if (scene.agrees[i] != 0 && age_us >= kTellingAge_us) mark.is_moving = false;
    ++i;
  }
}

void MovingThings::KeepLabels(const FeatureFrame& features) {
  labels_.assign(Index(grid_.num()), {});
  num_moving_ = num_going_ = 0;
  for (const Mark& mark : marks_) {
    if (mark.keypoint < 0 || (!mark.is_of_scene && !mark.is_moving)) continue;
    const std::optional<Eigen::Vector3d> point = PointFromDepth(features, mark.keypoint);
    labels_[Index(grid_.Of(mark.pixel_px.x(), mark.pixel_px.y()))].push_back(
        {point ? point->z() : 0.0, mark.is_moving});
    num_moving_ += mark.is_moving ? 1 : 0;
    num_going_ += mark.is_moving && mark.step_px.norm() > kStill_px ? 1 : 0;
  }
}

// Most of the marks around the keypoint, at its depth, move.
bool MovingThings::Covers(const FeatureFrame& features, int32_t keypoint) const {
  if (num_moving_ == 0) return false;
  const Eigen::Vector2d pixel_px = SeenAt(features, keypoint).pixel_px;
  const std::optional<Eigen::Vector3d> point = PointFromDepth(features, keypoint);
  const auto is_beside = [&](const Label& label) {
    return !point || label.depth_m == 0.0 || std::abs(point->z() - label.depth_m) <= kSameDepth * label.depth_m;
  };
  int num = 0, num_moving = 0;
  grid_.VisitAround(grid_.Of(pixel_px.x(), pixel_px.y()), [&](size_t cell) {
    for (const Label& label : labels_[cell]) {
      if (!is_beside(label)) continue;
      ++num;
      num_moving += label.is_moving ? 1 : 0;
    }
  });
  return 2 * num_moving > num;
}

}  // namespace tessera
