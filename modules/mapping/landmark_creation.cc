#include "mapping/landmark_creation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/triangulation.h"
#include "measurement/feature_grid.h"
#include "measurement/landmark_description.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

constexpr double kMinLever = 1e-8;          // squared sine of the angle between a ray and the way from view to view
constexpr double kMinLandmarkDepth = 1e-3;  // of a new one, in units of the map: nearer ones are false matches

LandmarkId AddLandmark(const Eigen::Vector3d& position_in_world, std::initializer_list<Observation> observations,
                       MapEditor& editor) {
  const LandmarkId id = editor.AddLandmark({.position_in_world = position_in_world});
  for (const Observation& observation : observations) {
    editor.AddObservation(id, observation);
  }
  editor.ChangeLandmark(id, DescribeLandmark(editor.map(), id));
  return id;
}

// By how much the camera turned, rad.
double AngleOf(const Rigid3& second_from_first) {
  return 2.0 * std::acos(std::min(1.0, std::abs(second_from_first.rotation.w())));
}

// The search for second views of one keyframe's keypoints in another.
class PairSearch {
 public:
  PairSearch(const Map& map, KeyframeId first, KeyframeId second, double min_depth, const CreationOptions& options)
      : options_(options),
        first_(*map.FindKeyframe(first)),
        second_(*map.FindKeyframe(second)),
        calibration_(first_.features->calibration),
        baseline_m_(Baseline(calibration_)),
        second_from_first_(second_.world_from_camera.Inverse() * first_.world_from_camera),
        rotation_(second_from_first_.rotation.toRotationMatrix()),
        roll_(RollBetween(second_from_first_)),
        max_inverse_depth_(1.0 / min_depth),
        min_parallax_of_turn_(options.min_parallax_per_turn * AngleOf(second_from_first_)) {
    for (int level = 0; level < kMaxLevels; ++level) {
      limits_px_[static_cast<size_t>(level)] = std::sqrt(kChi2LimitOfOne) * LevelScale(level);
    }
    // Only what sees no landmark yet is looked for.
    std::vector<Keypoint> keypoints;
    for (size_t i = 0; i < second_.landmarks.size(); ++i) {
      if (second_.landmarks[i].valid()) continue;
      keypoints.push_back(second_.features->keypoints[i]);
      free_.push_back(static_cast<int32_t>(i));
    }
    grid_ = FeatureGrid(keypoints, calibration_.width_px, calibration_.height_px);
  }

  // The keypoint of the second keyframe that sees the same point, and the point in the first camera's frame.
  struct Match {
    int32_t keypoint;
    Eigen::Vector3d point_in_first;
  };
  std::optional<Match> Find(int32_t keypoint) const;

 private:
  struct InverseDepths {
    double low;
    double high;
  };
  InverseDepths Bounds(const PixelObservation& seen) const;
  std::optional<int32_t> BestOnLine(int32_t keypoint, const PixelObservation& seen, const Eigen::Vector3d& ray) const;
  std::optional<Eigen::Vector3d> Triangulate(const PixelObservation& in_first, const PixelObservation& in_second) const;
  std::optional<Eigen::Vector3d> FarPoint(const Eigen::Vector3d& ray, const Eigen::Vector3d& ray_in_second,
                                          double noise_rad) const;
  bool IsConsistent(const Eigen::Vector3d& point_in_first, const PixelObservation& in_first,
                    const PixelObservation& in_second) const;

  const CreationOptions& options_;
  const Keyframe& first_;
  const Keyframe& second_;
  const CameraCalibration& calibration_;
  const double baseline_m_;
  const Rigid3 second_from_first_;
  const Eigen::Matrix3d rotation_;
  const uint8_t roll_;
  const double max_inverse_depth_;
  const double min_parallax_of_turn_;         // rad
  std::array<double, kMaxLevels> limits_px_;  // by level: how far from the line a keypoint may lie
  std::vector<int32_t> free_;                 // keypoints of the second keyframe that see no landmark
  FeatureGrid grid_;                          // of these, by their number in free_
};

// A disparity d +- 3 sigma stands for inverse depths (d +- 3 sigma) / (fx baseline).
PairSearch::InverseDepths PairSearch::Bounds(const PixelObservation& seen) const {
  if (!seen.has_right()) return {0.0, max_inverse_depth_};
  const double per_px = 1.0 / (calibration_.fx_px * baseline_m_);
  const double disparity_px = seen.pixel_px.x() - seen.right_x_px;
  return {std::max(0.0, (disparity_px - 3.0 * seen.sigma_px) * per_px), (disparity_px + 3.0 * seen.sigma_px) * per_px};
}

std::optional<PairSearch::Match> PairSearch::Find(int32_t keypoint) const {
  const PixelObservation seen = SeenAt(*first_.features, keypoint);
  const std::optional<int32_t> other = BestOnLine(keypoint, seen, calibration_.Ray(seen.pixel_px));
  if (!other) return std::nullopt;
  const PixelObservation seen_in_second = SeenAt(*second_.features, *other);
  const std::optional<Eigen::Vector3d> point = Triangulate(seen, seen_in_second);
  if (!point || !IsConsistent(*point, seen, seen_in_second)) return std::nullopt;
  return Match{*other, *point};
}

// A point at inverse depth w along the ray stands, up to scale, at R ray + w t in the second camera.
std::optional<int32_t> PairSearch::BestOnLine(int32_t keypoint, const PixelObservation& seen,
                                              const Eigen::Vector3d& ray) const {
  const InverseDepths bounds = Bounds(seen);
  const Eigen::Vector3d direction = rotation_ * ray;
  const Eigen::Vector3d far = direction + bounds.low * second_from_first_.translation;
  Eigen::Vector3d near = direction + bounds.high * second_from_first_.translation;
  if (far.z() < 0.05) return std::nullopt;  // leaves at the side or the back
  if (near.z() < 0.05) {                    // cut where the ray passes the camera
    near = far + (near - far) * ((far.z() - 0.05) / (far.z() - near.z()));
  }
  const Eigen::Vector2d a = calibration_.Project(far), b = calibration_.Project(near);
  const Eigen::Vector2d along = b - a;
  const double length = along.norm();
  const Eigen::Vector2d unit = length > 1e-9 ? Eigen::Vector2d(along / length) : Eigen::Vector2d::UnitX();

  const Keypoint& from = first_.features->keypoints[Index(keypoint)];
  const Descriptor& descriptor = first_.features->descriptors[Index(keypoint)];
  int best_distance = options_.max_hamming + 1, second_distance = 257;
  int32_t best = -1;
  Eigen::Vector2d best_px = Eigen::Vector2d::Zero();
  const double margin_px = limits_px_[static_cast<size_t>(std::min(kTopLevel, from.level + 2))];
  grid_.VisitSegment(a, b, margin_px, [&](int32_t number) {
    const int32_t candidate = free_[Index(number)];
    const Keypoint& to = second_.features->keypoints[Index(candidate)];
    if (second_.landmarks[Index(candidate)].valid() || std::abs(int{to.level} - int{from.level}) > 2) return;
    const Eigen::Vector2d offset = Eigen::Vector2d(to.x_px, to.y_px) - a;
    const double limit = limits_px_[std::min<size_t>(to.level, kMaxLevels - 1)];
    const double along_px = unit.dot(offset), aside_px = unit.x() * offset.y() - unit.y() * offset.x();
    if (std::abs(aside_px) > limit || along_px < -limit || along_px > length + limit) return;
    if (!AreAnglesNear(from.angle, to.angle, roll_)) return;
    const int distance = HammingDistance(descriptor, second_.features->descriptors[Index(candidate)]);
    const Eigen::Vector2d to_px(to.x_px, to.y_px);
    // The same corner found on another level is not a second candidate.
    const bool is_elsewhere = best < 0 || (to_px - best_px).norm() > 4.0 * LevelScale(to.level);
    if (distance < best_distance) {
      if (is_elsewhere && best >= 0) second_distance = best_distance;
      best_distance = distance;
      best = candidate;
      best_px = to_px;
    } else if (is_elsewhere && distance < second_distance) {
      second_distance = distance;
    }
  });
  if (best < 0 || best_distance > options_.max_hamming_ratio * second_distance) return std::nullopt;
  return best;
}

// From the two rays where they have parallax, from the disparity of one of them where that has more.
std::optional<Eigen::Vector3d> PairSearch::Triangulate(const PixelObservation& in_first,
                                                       const PixelObservation& in_second) const {
  const Eigen::Vector3d ray = calibration_.Ray(in_first.pixel_px);
  const Eigen::Vector3d ray_in_second = calibration_.Ray(in_second.pixel_px);
  const Eigen::Vector3d turned = rotation_ * ray;
  const double parallax = std::acos(std::min(1.0, turned.normalized().dot(ray_in_second.normalized())));
  const auto stereo_parallax = [&](const PixelObservation& seen) {
    return seen.has_right() ? (seen.pixel_px.x() - seen.right_x_px) / calibration_.fx_px : 0.0;
  };
  const double by_first = stereo_parallax(in_first), by_second = stereo_parallax(in_second);
  const double noise_rad = std::hypot(in_first.sigma_px, in_second.sigma_px) / calibration_.fx_px;
  const double min_parallax = options_.min_parallax_sigmas * noise_rad;
  if (parallax >= std::max({min_parallax, min_parallax_of_turn_, by_first, by_second})) {
    return TriangulateRays(second_from_first_, ray, ray_in_second);
  }
  if (!in_first.has_right() && !in_second.has_right()) {
    return FarPoint(ray, ray_in_second, std::hypot(noise_rad, min_parallax_of_turn_ / options_.min_parallax_sigmas));
  }
  if (std::max(by_first, by_second) < min_parallax) return std::nullopt;
  if (by_first >= by_second) return PointFromDisparity(calibration_, baseline_m_, in_first);
  const auto point = PointFromDisparity(calibration_, baseline_m_, in_second);
  return point ? std::optional<Eigen::Vector3d>(second_from_first_.Inverse() * *point) : std::nullopt;
}

// Two rays that are parallel up to noise, or diverge. The point at inverse depth w along the first one stands, up to
// scale, at a + w t in the second camera, a = R ray. With the second ray b of length 1 it is nearest to that for
//
//   w = -(b x a) . (b x t) / |b x t|^2,    sigma_w = noise |ray| / |b x t|
//
// and w may come out negative. What is left of its distribution above zero has its mean at about
// (w + sqrt(w^2 + 2 sigma_w^2)) / 2.
std::optional<Eigen::Vector3d> PairSearch::FarPoint(const Eigen::Vector3d& ray, const Eigen::Vector3d& ray_in_second,
                                                    double noise_rad) const {
  const Eigen::Vector3d b = ray_in_second.normalized();
  const Eigen::Vector3d aside = b.cross(rotation_ * ray), by_depth = b.cross(second_from_first_.translation);
  const double squared = by_depth.squaredNorm();
  if (squared < kMinLever * second_from_first_.translation.squaredNorm()) return std::nullopt;
  const double w = -aside.dot(by_depth) / squared, sigma = noise_rad * ray.norm() / std::sqrt(squared);
  return Eigen::Vector3d(2.0 / (w + std::sqrt(w * w + 2.0 * sigma * sigma)) * ray);
}

bool PairSearch::IsConsistent(const Eigen::Vector3d& point_in_first, const PixelObservation& in_first,
                              const PixelObservation& in_second) const {
  const Eigen::Vector3d point_in_second = second_from_first_ * point_in_first;
  if (point_in_first.z() < kMinLandmarkDepth || point_in_second.z() < kMinLandmarkDepth) return false;
  for (const auto& [point, seen] : {std::pair(point_in_first, in_first), std::pair(point_in_second, in_second)}) {
    const Eigen::Vector3d residual = ReprojectionResidual(calibration_, baseline_m_, point, seen);
    if (residual.squaredNorm() > Chi2Limit(seen.has_right())) return false;
  }
  // A patch twice as far away looks half as large: distance / sigma must be alike, up to one and a half levels' ratio.
  const double ratio = point_in_second.norm() / in_second.sigma_px / (point_in_first.norm() / in_first.sigma_px);
  const double max_ratio = 1.5 * LevelScale(1);
  return ratio < max_ratio && ratio * max_ratio > 1.0;
}

// The keyframe's keypoints that see no landmark yet, each with its match in the other keyframe.
void CreateFromPair(KeyframeId id, KeyframeId other_id, const PairSearch& search, std::vector<LandmarkId>& created,
                    MapEditor& editor) {
  const Keyframe& keyframe = *editor.map().FindKeyframe(id);
  const Keyframe& other = *editor.map().FindKeyframe(other_id);
  for (int32_t i = 0; i < static_cast<int32_t>(keyframe.landmarks.size()); ++i) {
    if (keyframe.landmarks[Index(i)].valid()) continue;
    const auto match = search.Find(i);
    if (!match || other.landmarks[Index(match->keypoint)].valid()) continue;
    const Eigen::Vector3d position = keyframe.world_from_camera * match->point_in_first;
    created.push_back(AddLandmark(position, {{id, i}, {other_id, match->keypoint}}, editor));
  }
}

}  // namespace

Result<> CreationOptions::Check() const {
  if (max_neighbors < 1) return Failed("new landmarks need at least one neighbor to be searched");
  if (!(min_parallax_sigmas > 0.0) || !(min_parallax_per_turn >= 0.0) || !(min_baseline_share > 0.0))
    return Failed("the least parallax and baseline of new landmarks must be positive");
  if (max_hamming < 1 || max_hamming > 256)
    return Failed("the Hamming distance of new landmarks must be between 1 and 256");
  return {};
}

std::vector<LandmarkId> CreateFromDepth(KeyframeId id, const CreationOptions& options, MapEditor& editor) {
  const Keyframe& keyframe = *editor.map().FindKeyframe(id);
  const FeatureFrame& features = *keyframe.features;
  struct DepthPoint {
    int32_t keypoint;
    Eigen::Vector3d point_in_camera;
  };
  std::vector<DepthPoint> points;
  for (int32_t i = 0; i < static_cast<int32_t>(features.keypoints.size()); ++i) {
    if (const auto point = PointFromDepth(features, i)) points.push_back({i, *point});
  }
  std::stable_sort(points.begin(), points.end(), [](const DepthPoint& a, const DepthPoint& b) {
    return a.point_in_camera.z() < b.point_in_camera.z();
  });
  const double max_depth_m = options.max_depth_baselines * Baseline(features.calibration);
  std::vector<LandmarkId> created;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& [keypoint, point_in_camera] = points[i];
    if (point_in_camera.z() > max_depth_m && i >= static_cast<size_t>(options.min_depth_points)) break;
    if (!keyframe.landmarks[Index(keypoint)].valid()) {
      created.push_back(AddLandmark(keyframe.world_from_camera * point_in_camera, {{id, keypoint}}, editor));
    }
  }
  return created;
}

std::vector<LandmarkId> CreateFromPairs(KeyframeId id, const CreationOptions& options, MapEditor& editor) {
  const Map& map = editor.map();
  const Keyframe& keyframe = *map.FindKeyframe(id);
  const std::vector<double> depths = LandmarkDepths(map, keyframe);
  std::vector<LandmarkId> created;
  if (depths.empty()) return created;
  const double min_depth = depths[depths.size() / 20] / 3.0, median_depth = depths[depths.size() / 2];
  const double camera_baseline_m = Baseline(keyframe.features->calibration);
  const double min_baseline = camera_baseline_m > 0.0 ? camera_baseline_m : options.min_baseline_share * median_depth;

  for (const KeyframeId other_id : map.Covisible(id, options.max_neighbors)) {
    const Keyframe& other = *map.FindKeyframe(other_id);
    const double baseline = (other.world_from_camera.translation - keyframe.world_from_camera.translation).norm();
    if (baseline < min_baseline) continue;
    CreateFromPair(id, other_id, PairSearch(map, id, other_id, min_depth, options), created, editor);
  }
  return created;
}

}  // namespace tessera
