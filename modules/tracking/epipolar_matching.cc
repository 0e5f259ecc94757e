#include "tracking/epipolar_matching.h"

#include <algorithm>
#include <optional>

namespace tessera {
namespace {

struct Segment {
  Eigen::Vector2d far_px;   // image of the ray's point at infinity
  Eigen::Vector2d near_px;  // image of its point at min_depth
  Eigen::Vector2d normal;   // unit, across the line
};

// Image in the second camera of the first camera's ray, between min_depth and infinity. With w = 1/z the image is that
// of R ray + w t; only w for which it lies in front of the camera counts. nullopt if none does or the segment is a point.
std::optional<Segment> ImageOfRay(const CameraCalibration& calibration, const Rigid3& second_from_first,
                                  const Eigen::Vector3d& ray, double min_depth) {
  constexpr double kMinZ = 1e-2;  // of R ray + w t; nearer the image is out of all bounds
  const Eigen::Vector3d direction = second_from_first.rotation * ray;
  const Eigen::Vector3d& t = second_from_first.translation;
  double w_begin = 0.0, w_end = 1.0 / min_depth;
  if (direction.z() + w_begin * t.z() < kMinZ) {
    if (t.z() <= 0.0) {
      return std::nullopt;
    }
    w_begin = (kMinZ - direction.z()) / t.z();
  }
  if (direction.z() + w_end * t.z() < kMinZ) {
    w_end = (kMinZ - direction.z()) / t.z();
  }
  if (!(w_begin < w_end)) {
    return std::nullopt;
  }
  Segment segment;
  segment.far_px = calibration.Project(direction + w_begin * t);
  segment.near_px = calibration.Project(direction + w_end * t);
  const Eigen::Vector2d along = segment.near_px - segment.far_px;
  if (!(along.norm() > 1e-3)) {
    return std::nullopt;
  }
  segment.normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
  return segment;
}

// Whether the pixel lies within `limit_px` of the segment, ends included.
bool IsNear(const Segment& segment, const Eigen::Vector2d& pixel_px, double limit_px) {
  if (std::abs(segment.normal.dot(pixel_px - segment.far_px)) > limit_px) {
    return false;
  }
  const Eigen::Vector2d along = segment.near_px - segment.far_px;
  const double length = along.norm();
  const double place = along.dot(pixel_px - segment.far_px) / length;
  return place >= -limit_px && place <= length + limit_px;
}

}  // namespace

std::vector<Match> MatchAlongEpipolarLines(const FrameView& first, std::span<const int32_t> of_first,
                                           const FrameView& second, std::span<const char> is_free_in_second,
                                           const Rigid3& second_from_first, const EpipolarOptions& options) {
  std::vector<Match> matches;
  for (const int32_t i : of_first) {
    const std::optional<Segment> segment =
        ImageOfRay(second.calibration(), second_from_first, first.ray(i), options.min_depth);
    if (!segment) {
      continue;
    }
    const int level = first.keypoint(i).level;
    const double reach_px = options.max_distance * second.sigma_px(level + 2);
    BestMatch best;
    second.grid().VisitSegment(segment->far_px, segment->near_px, reach_px, [&](int32_t j) {
      if (!is_free_in_second[static_cast<size_t>(j)] || std::abs(second.keypoint(j).level - level) > 2 ||
          !IsNear(*segment, second.pixel(j), options.max_distance * second.sigma_px(second.keypoint(j).level))) {
        return;
      }
      best.Offer(j, HammingDistance(first.descriptor(i), second.descriptor(j)));
    });
    if (best.IsClear(options.matching)) {
      matches.push_back({i, best.index, best.distance});
    }
  }
  return DropUnlikeTurns(KeepBestPerSecond(std::move(matches), second.size()), first, second, options.matching);
}

}  // namespace tessera
