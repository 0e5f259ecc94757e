#include "matching/ground_speed.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "features/pyramid.h"

namespace tessera {
namespace {

// Heights: what lies farther ahead shows little of the step and much of how the ground bends; farther aside it is no
// road any more.
constexpr double kMaxAhead = 14.0, kMaxAside = 5.0;
constexpr double kMaxAheadBefore = 50.0;  // of the keypoints of the last view
constexpr size_t kMaxKeypoints = 100;     // on the ground; of more, every second, third ... is asked
constexpr int kMinKeypoints = 3;
constexpr int kMaxHamming = 64;
constexpr int kMaxLevels = 2;      // between two keypoints of one point
constexpr double kMaxScale = 1.5;  // and what is left of that when its distances are allowed for
constexpr double kSigmaPx = 0.7;   // of their distance, in pixels of their level
constexpr double kMaxSigmas = 3.0;
constexpr double kFlatness = 0.03;    // standard deviation of the logarithm of a speed: the ground is no plane
constexpr double kOdds = 3.0 / 7.0;   // that a keypoint on the ground was seen before
constexpr double kMaxRatio = 1000.0;  // what one keypoint may say: it may stand on the ground, not lie there
constexpr double kCellPx = 40.0;      // in which the density of keypoints is counted
constexpr double kMinDepth = 0.2;     // heights, before the camera

class KeypointDensity {
 public:
  explicit KeypointDensity(const FrameView& view)
      : columns_(static_cast<int>(view.calibration().width_px / kCellPx) + 1),
        rows_(static_cast<int>(view.calibration().height_px / kCellPx) + 1),
        counts_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)) {
    for (int i = 0; i < view.size(); ++i) counts_[CellOf(view.pixel(i))] += 1.0;
  }

  // Keypoints per square pixel around here.
  double At(const Eigen::Vector2d& pixel) const { return (counts_[CellOf(pixel)] + 1.0) / (kCellPx * kCellPx); }

 private:
  size_t CellOf(const Eigen::Vector2d& pixel) const {
    const int column = std::clamp(static_cast<int>(pixel.x() / kCellPx), 0, columns_ - 1);
    const int row = std::clamp(static_cast<int>(pixel.y() / kCellPx), 0, rows_ - 1);
    return static_cast<size_t>(row) * static_cast<size_t>(columns_) + static_cast<size_t>(column);
  }

  int columns_, rows_;
  std::vector<double> counts_;
};

struct GroundKeypoint {
  int keypoint = -1;
  Eigen::Vector3d ray;
  Eigen::Vector3d point;  // heights, in the frame of the view's camera
};

// Keypoints that see the ground, if it is a plane, at most so far ahead and aside.
std::vector<GroundKeypoint> KeypointsOnGround(const FrameView& view, const Eigen::Vector3d& down, double max_ahead,
                                              double max_aside) {
  std::vector<GroundKeypoint> found;
  for (int i = 0; i < view.size(); ++i) {
    const Eigen::Vector3d ray = view.calibration().Ray(view.pixel(i));
    const double slope = down.dot(ray);
    if (slope * max_ahead < 1.0 || std::abs(ray.x()) > max_aside * slope) continue;
    found.push_back({i, ray, ray / slope});
  }
  return found;
}

// A keypoint of the last view that may have seen a point of the ground.
struct Candidate {
  int keypoint = -1;
  int distance = 0;   // bits
  double step = 0.0;  // heights: the one that fits best
  double sigma_px = 0.0;
  double squared_sigmas = 0.0;  // how far it lies beside what it should be on
  double log_sigma = 0.0;       // of the step's logarithm
};

// The votes of the keypoints on the ground, one after the other.
class GroundVotes {
 public:
  GroundVotes(const FrameView& last, const FrameView& current, const Rigid3& last_from_current,
              const Eigen::Vector3d& down, double interval_s)
      : last_(last),
        current_(current),
        rotation_(last_from_current.rotation.toRotationMatrix()),
        direction_(last_from_current.translation.normalized()),
        min_step_(kMinGroundSpeed * interval_s),
        density_(last),
        before_(KeypointsOnGround(last, rotation_ * down, kMaxAheadBefore, kMaxAheadBefore)) {}

  // False if there is nothing it could have been.
  bool Add(const GroundKeypoint& seen) {
    FindCandidates(seen);
    if (candidates_.empty()) return false;
    GroundSpeeds ratios{};
    for (const Candidate& candidate : candidates_) AddRatio(candidate, ratios);
    for (size_t i = 0; i < ratios.size(); ++i) {
      if (ratios[i] > 0.0) sum_[i] += std::log(1.0 + kOdds * ratios[i] / (1.0 + ratios[i] / kMaxRatio));
    }
    return true;
  }
  const GroundSpeeds& sum() const { return sum_; }

 private:
  // Sets candidates_, and counts those elsewhere that look alike.
  void FindCandidates(const GroundKeypoint& seen) {
    candidates_.clear();
    elsewhere_.fill(0);
    num_compared_ = 0;
    const int level = current_.keypoint(seen.keypoint).level;
    const Descriptor& descriptor = current_.descriptor(seen.keypoint);
    const Eigen::Vector3d point = rotation_ * seen.point;
    for (const GroundKeypoint& before : before_) {
      if (std::abs(last_.keypoint(before.keypoint).level - level) > kMaxLevels) continue;
      ++num_compared_;
      const int distance = HammingDistance(descriptor, last_.descriptor(before.keypoint));
      if (distance > kMaxHamming) continue;
      const std::optional<Candidate> candidate = Compare(point, seen.point.z(), level, before);
      if (candidate) {
        candidates_.push_back(*candidate);
        candidates_.back().distance = distance;
      } else {
        ++elsewhere_[static_cast<size_t>(distance)];
      }
    }
    for (size_t i = 1; i < elsewhere_.size(); ++i) elsewhere_[i] += elsewhere_[i - 1];
  }

  // The step s that brings the point nearest to the other ray r:  r x (p + s d) = 0,  by least squares. nullopt if
  // that isn't near, or the point would look larger or smaller than it does.
  std::optional<Candidate> Compare(const Eigen::Vector3d& point, double depth, int level,
                                   const GroundKeypoint& before) const {
    const int other_level = last_.keypoint(before.keypoint).level;
    const double focal_px = last_.calibration().fx_px;
    const double sigma_px = kSigmaPx * LevelScale(std::max(level, other_level));
    const Eigen::Vector3d of_point = before.ray.cross(point), of_step = before.ray.cross(direction_);
    const double step = -of_point.dot(of_step) / of_step.squaredNorm();
    if (!(step > 0.0)) return std::nullopt;
    const Eigen::Vector3d moved = point + step * direction_;
    if (moved.z() < kMinDepth) return std::nullopt;
    const Eigen::Vector2d at = moved.head<2>() / moved.z();
    const double squared_sigmas =
        (at - before.ray.head<2>()).squaredNorm() * focal_px * focal_px / (sigma_px * sigma_px);
    if (squared_sigmas > kMaxSigmas * kMaxSigmas) return std::nullopt;
    const double scale = LevelScale(level) / LevelScale(other_level) * depth / moved.z();
    if (scale > kMaxScale || scale * kMaxScale < 1.0) return std::nullopt;
    const Eigen::Vector2d px_per_step = focal_px / moved.z() * (direction_.head<2>() - direction_.z() * at);
    const double log_sigma = sigma_px / std::max(px_per_step.norm() * step, 1e-9);
    return Candidate{before.keypoint, 0, step, sigma_px, squared_sigmas, log_sigma};
  }

  void AddRatio(const Candidate& candidate, GroundSpeeds& ratios) const {
    const double share_alike =
        (elsewhere_[static_cast<size_t>(candidate.distance)] + 0.2) / (static_cast<double>(num_compared_) + 10.0);
    const double by_chance = share_alike * density_.At(last_.pixel(candidate.keypoint));
    const double variance_px = candidate.sigma_px * candidate.sigma_px;
    const double sigma = std::hypot(candidate.log_sigma, kFlatness);
    const double peak = std::exp(-0.5 * candidate.squared_sigmas) / (2.0 * std::numbers::pi * variance_px) / by_chance *
                        candidate.log_sigma / sigma;
    const double middle = std::log(candidate.step / min_step_) / kGroundSpeedStep - 0.5;
    const double reach = kMaxSigmas * sigma / kGroundSpeedStep;
    const int from = std::max(0, static_cast<int>(std::ceil(std::max(middle - reach, -1.0))));
    const int to = static_cast<int>(std::floor(std::min(middle + reach, kNumGroundSpeeds - 1.0)));
    for (int i = from; i <= to; ++i) {
      const double sigmas = (i - middle) * kGroundSpeedStep / sigma;
      ratios[static_cast<size_t>(i)] += peak * std::exp(-0.5 * sigmas * sigmas);
    }
  }

  const FrameView& last_;
  const FrameView& current_;
  const Eigen::Matrix3d rotation_;   // last from current
  const Eigen::Vector3d direction_;  // in the last camera
  const double min_step_;            // heights
  const KeypointDensity density_;
  const std::vector<GroundKeypoint> before_;
  std::vector<Candidate> candidates_;
  std::array<int, kMaxHamming + 1> elsewhere_{};  // by distance, or less: how many look alike and can't be it
  int num_compared_ = 0;
  GroundSpeeds sum_{};
};

}  // namespace

std::optional<GroundSpeeds> SpeedOverGround(const FrameView& last, const FrameView& current,
                                            const Rigid3& last_from_current, const Eigen::Vector3d& down,
                                            double interval_s) {
  if (last_from_current.translation.isZero(0.0)) return std::nullopt;
  const std::vector<GroundKeypoint> ground = KeypointsOnGround(current, down, kMaxAhead, kMaxAside);
  const size_t stride = ground.size() / kMaxKeypoints + 1;
  GroundVotes votes(last, current, last_from_current, down, interval_s);
  int num_voters = 0;
  for (size_t i = 0; i < ground.size(); i += stride) num_voters += votes.Add(ground[i]) ? 1 : 0;
  if (num_voters < kMinKeypoints) return std::nullopt;
  return votes.sum();
}

}  // namespace tessera
