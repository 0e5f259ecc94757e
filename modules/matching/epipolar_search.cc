#include "matching/epipolar_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/triangulation.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

constexpr double kMinLever = 1e-8;       // squared sine of the angle between a ray and the way from view to view
constexpr double kMinPointDepth = 1e-3;  // of a point, in units of the map: nearer ones are false matches

// By how much the camera turned, rad.
double AngleOf(const Rigid3& second_from_first) {
  return 2.0 * std::acos(std::min(1.0, std::abs(second_from_first.rotation.w())));
}

}  // namespace

Result<> EpipolarOptions::Check() const {
  if (!(min_parallax_sigmas > 0.0) || !(min_parallax_per_turn >= 0.0))
    return Failed("the least parallax of new points must be positive");
  if (max_hamming < 1 || max_hamming > 256)
    return Failed("the Hamming distance of new points must be between 1 and 256");
  if (!(max_by_chance > 0.0)) return Failed("the number of matches by chance of new points must be positive");
  return {};
}

EpipolarSearch::EpipolarSearch(const FeatureFrame& first, const FeatureFrame& second, const Rigid3& second_from_first,
                               std::function<bool(int32_t)> is_free, double min_depth, const EpipolarOptions& options)
    : options_(options),
      first_(first),
      second_(second),
      calibration_(first_.calibration),
      baseline_m_(Baseline(calibration_)),
      second_from_first_(second_from_first),
      rotation_(second_from_first_.rotation.toRotationMatrix()),
      roll_(RollBetween(second_from_first_)),
      max_inverse_depth_(1.0 / min_depth),
      min_parallax_of_turn_(options.min_parallax_per_turn * AngleOf(second_from_first_)),
      is_free_(std::move(is_free)),
      grid_(second_.keypoints, calibration_.width_px, calibration_.height_px, is_free_) {
  for (int level = 0; level < kMaxLevels; ++level) {
    limits_px_[static_cast<size_t>(level)] = std::sqrt(kChi2LimitOfOne) * LevelScale(level);
  }
}

// A disparity d +- 3 sigma stands for inverse depths (d +- 3 sigma) / (fx baseline).
EpipolarSearch::InverseDepths EpipolarSearch::Bounds(const PixelObservation& seen) const {
  if (!seen.has_right()) return {0.0, max_inverse_depth_};
  const double per_px = 1.0 / (calibration_.fx_px * baseline_m_);
  const double disparity_px = seen.pixel_px.x() - seen.right_x_px;
  return {std::max(0.0, (disparity_px - 3.0 * seen.sigma_px) * per_px), (disparity_px + 3.0 * seen.sigma_px) * per_px};
}

std::optional<EpipolarSearch::Match> EpipolarSearch::Find(int32_t keypoint) const {
  const PixelObservation seen = SeenAt(first_, keypoint);
  const std::optional<Segment> line = LineOf(seen);
  if (!line) return std::nullopt;
  const std::optional<Candidate> found = BestOnLine(keypoint, *line);
  if (!found) return std::nullopt;
  const PixelObservation seen_in_second = SeenAt(second_, found->keypoint);
  const std::optional<Eigen::Vector3d> point = Triangulate(seen, seen_in_second);
  if (!point || !IsConsistent(*point, seen, seen_in_second)) return std::nullopt;
  if (NumByChance(keypoint, *line, *found) > options_.max_by_chance) return std::nullopt;
  return Match{found->keypoint, *point};
}

// A point at inverse depth w along the ray stands, up to scale, at R ray + w t in the second camera.
std::optional<EpipolarSearch::Segment> EpipolarSearch::LineOf(const PixelObservation& seen) const {
  const InverseDepths bounds = Bounds(seen);
  const Eigen::Vector3d direction = rotation_ * calibration_.Ray(seen.pixel_px);
  const Eigen::Vector3d far = direction + bounds.low * second_from_first_.translation;
  Eigen::Vector3d near = direction + bounds.high * second_from_first_.translation;
  if (far.z() < 0.05) return std::nullopt;  // leaves at the side or the back
  if (near.z() < 0.05) {                    // cut where the ray passes the camera
    near = far + (near - far) * ((far.z() - 0.05) / (far.z() - near.z()));
  }
  Segment line{calibration_.Project(far), calibration_.Project(near), Eigen::Vector2d::UnitX(), 0.0};
  if (options_.needs_far_end && !IsInImage(calibration_, line.begin)) return std::nullopt;
  const Eigen::Vector2d along = line.end - line.begin;
  line.length_px = along.norm();
  if (line.length_px > 1e-9) line.direction = along / line.length_px;
  return line;
}

bool EpipolarSearch::Segment::IsNear(float x_px, float y_px, double limit_px) const {
  const double from_begin_x = static_cast<double>(x_px) - begin.x();
  const double from_begin_y = static_cast<double>(y_px) - begin.y();
  const double along_px = direction.x() * from_begin_x + direction.y() * from_begin_y;
  const double aside_px = direction.x() * from_begin_y - direction.y() * from_begin_x;
  // One branch for the caller, nearly always the same: by turns, each condition would be guessed wrong for many.
  bool is_near = std::abs(aside_px) <= limit_px;
  is_near &= along_px >= -limit_px;
  is_near &= along_px <= length_px + limit_px;
  return is_near;
}

PatchRange EpipolarSearch::PatchesLike(const Keypoint& keypoint) const {
  return PatchRange::Levels(keypoint.level - 2, keypoint.level + 2).WithAnglesNear(keypoint.angle + roll_);
}

std::optional<EpipolarSearch::Candidate> EpipolarSearch::BestOnLine(int32_t keypoint, const Segment& line) const {
  const Keypoint& from = first_.keypoints[Index(keypoint)];
  const Descriptor& descriptor = first_.descriptors[Index(keypoint)];
  Candidate best{-1, options_.max_hamming + 1, 0};
  int second_distance = 257;
  Eigen::Vector2d best_px = Eigen::Vector2d::Zero();
  const double margin_px = limits_px_[static_cast<size_t>(std::min(kTopLevel, from.level + 2))];
  grid_.VisitSegment(line.begin, line.end, margin_px, PatchesLike(from), [&](const PlacedKeypoint& to) {
    const double limit = limits_px_[std::min<size_t>(to.level, kMaxLevels - 1)];
    if (!line.IsNear(to.x_px, to.y_px, limit) || !is_free_(to.index)) return;
    ++best.num_on_line;
    const int distance = HammingDistance(descriptor, second_.descriptors[Index(to.index)]);
    const Eigen::Vector2d to_px(to.x_px, to.y_px);
    // The same corner found on another level is not a second candidate.
    const auto is_elsewhere = [&] {
      return best.keypoint < 0 || (to_px - best_px).norm() > 4.0 * LevelScale(to.level);
    };
    if (distance < best.distance) {
      if (best.keypoint >= 0 && is_elsewhere()) second_distance = best.distance;
      best.distance = distance;
      best.keypoint = to.index;
      best_px = to_px;
    } else if (distance < second_distance && is_elsewhere()) {
      second_distance = distance;
    }
  });
  if (best.keypoint < 0 || best.distance > options_.max_hamming_ratio * second_distance) return std::nullopt;
  return best;
}

// n (k + 0.2) / (N + 10), see the class: if nothing is elsewhere, one of fifty on the line would agree by chance.
double EpipolarSearch::NumByChance(int32_t keypoint, const Segment& line, const Candidate& found) const {
  const Keypoint& from = first_.keypoints[Index(keypoint)];
  const Descriptor& descriptor = first_.descriptors[Index(keypoint)];
  // Well away from the line: the point itself may be seen beside it, if the poses are wrong.
  const double margin_px = 3.0 * limits_px_[static_cast<size_t>(std::min(kTopLevel, from.level + 2))];
  int num_elsewhere = 0, num_alike = 0;
  grid_.VisitAll(PatchesLike(from), [&](const PlacedKeypoint& to) {
    if (line.IsNear(to.x_px, to.y_px, margin_px)) return;
    ++num_elsewhere;
    num_alike += HammingDistance(descriptor, second_.descriptors[Index(to.index)]) <= found.distance ? 1 : 0;
  });
  return found.num_on_line * (num_alike + 0.2) / (num_elsewhere + 10.0);
}

// From the two rays where they have parallax, from the disparity of one of them where that has more.
std::optional<Eigen::Vector3d> EpipolarSearch::Triangulate(const PixelObservation& in_first,
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
std::optional<Eigen::Vector3d> EpipolarSearch::FarPoint(const Eigen::Vector3d& ray,
                                                        const Eigen::Vector3d& ray_in_second, double noise_rad) const {
  const Eigen::Vector3d b = ray_in_second.normalized();
  const Eigen::Vector3d aside = b.cross(rotation_ * ray), by_depth = b.cross(second_from_first_.translation);
  const double squared = by_depth.squaredNorm();
  if (squared < kMinLever * second_from_first_.translation.squaredNorm()) return std::nullopt;
  const double w = -aside.dot(by_depth) / squared, sigma = noise_rad * ray.norm() / std::sqrt(squared);
  return Eigen::Vector3d(2.0 / (w + std::sqrt(w * w + 2.0 * sigma * sigma)) * ray);
}

bool EpipolarSearch::IsConsistent(const Eigen::Vector3d& point_in_first, const PixelObservation& in_first,
                                  const PixelObservation& in_second) const {
  const Eigen::Vector3d point_in_second = second_from_first_ * point_in_first;
  if (point_in_first.z() < kMinPointDepth || point_in_second.z() < kMinPointDepth) return false;
  for (const auto& [point, seen] : {std::pair(point_in_first, in_first), std::pair(point_in_second, in_second)}) {
    const Eigen::Vector3d residual = ReprojectionResidual(calibration_, baseline_m_, point, seen);
    if (SquaredNorm(residual) > Chi2Limit(seen.has_right())) return false;
  }
  // A patch twice as far away looks half as large: distance / sigma must be alike, up to one and a half levels' ratio.
  const double ratio = point_in_second.norm() / in_second.sigma_px / (point_in_first.norm() / in_first.sigma_px);
  const double max_ratio = 1.5 * LevelScale(1);
  return ratio < max_ratio && ratio * max_ratio > 1.0;
}

}  // namespace tessera
