#include "loop_closing/link_covariance.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/time_units.h"
#include "geometry/reprojection.h"
#include "measurement/keypoint_measurement.h"
#include "measurement/landmark_view.h"

namespace tessera {
namespace {

// What one observation says about the landmark's position in the world, the camera's pose taken as exact.
Eigen::Matrix3d PositionInformation(const Keyframe& keyframe, int32_t keypoint, const Eigen::Vector3d& position) {
  const FeatureFrame& features = *keyframe.features;
  const Eigen::Matrix3d camera_from_world = keyframe.world_from_camera.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d point = camera_from_world * (position - keyframe.world_from_camera.translation);
  if (point.z() < kMinDepth) return Eigen::Matrix3d::Zero();
  const Reprojection seen =
      Reproject(features.calibration, Baseline(features.calibration), point, SeenAt(features, keypoint));
  const Eigen::Matrix3d by_position = seen.by_point * camera_from_world;
  return by_position.transpose() * by_position;
}

// (A^-1 + B^-1)^-1, also where one of them is singular.
Eigen::Matrix3d ParallelSum(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  constexpr double kRegular = 1e-12;
  Eigen::Matrix3d sum = a + b;
  if (!(sum.trace() > 0.0)) return Eigen::Matrix3d::Zero();  // a point behind all of its observers tells nothing
  sum.diagonal().array() += kRegular * sum.trace();
  const Eigen::Matrix3d parallel = a * sum.inverse() * b;
  return 0.5 * (parallel + parallel.transpose());
}

// H's share of a landmark.
Matrix7 SeenFrom(const Keyframe& newer, const Eigen::Vector3d& position, const Eigen::Matrix3d& information) {
  const Eigen::Matrix3d camera_from_world = newer.world_from_camera.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d point = camera_from_world * (position - newer.world_from_camera.translation);
  Eigen::Matrix<double, 3, 7> by_error;
  by_error << Eigen::Matrix3d::Identity(), -Skew(point), point;
  const Eigen::Matrix<double, 3, 7> in_world = camera_from_world.transpose() * by_error;
  return in_world.transpose() * information * in_world;
}

// By newer keyframe: the older ones that it is linked to, and the number of that link.
using LinksOf = std::map<KeyframeId, std::vector<std::pair<KeyframeId, size_t>>>;

LinksOf IndexLinks(std::span<const KeyframePair> links) {
  LinksOf links_of;
  for (size_t i = 0; i < links.size(); ++i) links_of[links[i].newer].emplace_back(links[i].older, i);
  for (auto& [newer, older] : links_of) std::ranges::sort(older);
  return links_of;
}

// Adds what the landmark contributes to every link between two of its observers.
void AddLandmark(const Map& map, LandmarkId id, const LinksOf& links_of, std::vector<Matrix7>& information) {
  const Eigen::Vector3d& position = map.FindLandmark(id)->position_in_world;
  const std::span<const Observation> seen = map.ObservationsOf(id);
  std::vector<Eigen::Matrix3d> up_to(seen.size()), from;
  for (size_t i = 0; i < seen.size(); ++i) {
    up_to[i] = PositionInformation(*map.FindKeyframe(seen[i].keyframe), seen[i].keypoint, position);
  }
  from = up_to;
  for (size_t i = 1; i < seen.size(); ++i) up_to[i] += up_to[i - 1];
  for (size_t i = seen.size(); i-- > 1;) from[i - 1] += from[i];
  for (size_t newer = 1; newer < seen.size(); ++newer) {
    const auto links = links_of.find(seen[newer].keyframe);
    if (links == links_of.end()) continue;
    const Keyframe& keyframe = *map.FindKeyframe(seen[newer].keyframe);
    size_t older = 0;
    for (const auto& [keyframe_before, link] : links->second) {  // both lists are by id
      while (older < newer && seen[older].keyframe < keyframe_before) ++older;
      if (older == newer) break;
      if (seen[older].keyframe != keyframe_before) continue;
      information[link] += SeenFrom(keyframe, position, ParallelSum(up_to[older], from[newer]));
    }
  }
}

std::vector<Matrix7> LinkInformation(const Map& map, std::span<const KeyframePair> links) {
  std::vector<Matrix7> information(links.size(), Matrix7::Zero());
  const LinksOf links_of = IndexLinks(links);
  map.landmarks().ForEach([&](LandmarkId id, const Landmark&) { AddLandmark(map, id, links_of, information); });
  return information;
}

Matrix7 BoundedInverse(Matrix7 information, double length, bool has_scale) {
  const double translation = kLinkBounds.depths * length;
  information /= kInflation;
  if (!has_scale) {
    information.row(6).setZero();
    information.col(6).setZero();
  }
  information.diagonal().head<3>().array() += 1.0 / (translation * translation);
  information.diagonal().segment<3>(3).array() += 1.0 / (kLinkBounds.rotation_rad * kLinkBounds.rotation_rad);
  information(6, 6) += 1.0 / (kLinkBounds.log_scale * kLinkBounds.log_scale);
  return information.inverse();
}

constexpr double kSlipWindow_s = 1.0;

// A keyframe and its step from the one before.
struct Step {
  double end_s = 0.0;
  double duration_s = 0.0;
  double log_speed = 0.0;  // units of the map per second
  double log_depth = 0.0;  // median, at its end
};

std::vector<Step> StepsOf(const Map& map, std::span<const KeyframeId> part, const MedianDepths& depths) {
  constexpr double kLeastShare = 1e-3;  // of the depth, a second: slower is standing still
  std::vector<Step> steps(part.size());
  for (size_t i = 0; i < part.size(); ++i) {
    const Keyframe& keyframe = *map.FindKeyframe(part[i]);
    const double depth = depths.at(part[i]);
    steps[i].end_s = SecondsOf(keyframe.features->utime_us);
    steps[i].log_depth = std::log(depth);
    steps[i].log_speed = std::log(kLeastShare * depth);
    if (i == 0) continue;
    const Keyframe& before = *map.FindKeyframe(part[i - 1]);
    steps[i].duration_s = steps[i].end_s - steps[i - 1].end_s;
    const double way = (keyframe.world_from_camera.translation - before.world_from_camera.translation).norm();
    if (!(steps[i].duration_s > 0.0)) continue;
    steps[i].log_speed = std::max(steps[i].log_speed, std::log(way / steps[i].duration_s));
  }
  return steps;
}

// By how much the logarithms of both speed and depth change at the end of step i, if in the same direction.
double CommonChange(const std::vector<Step>& steps, size_t i) {
  Eigen::Vector2d before(0.0, 0.0), after(0.0, 0.0);
  int num_before = 0, num_after = 0;
  for (size_t k = i + 1; k-- > 1 && steps[i].end_s - steps[k].end_s < kSlipWindow_s; ++num_before) {
    before += Eigen::Vector2d(steps[k].log_speed, steps[k].log_depth);
  }
  for (size_t k = i + 1; k < steps.size() && steps[k].end_s - steps[i].end_s <= kSlipWindow_s; ++k, ++num_after) {
    after += Eigen::Vector2d(steps[k].log_speed, steps[k].log_depth);
  }
  if (num_before == 0 || num_after == 0) return 0.0;
  const Eigen::Vector2d change = after / num_after - before / num_before;
  return change.x() * change.y() > 0.0 ? change.cwiseAbs().minCoeff() : 0.0;
}

// By keyframe of the part: the variance of the log scale by slips from the first one to it.
std::map<KeyframeId, double> SlipVariances(const Map& map, std::span<const KeyframeId> part,
                                           const MedianDepths& depths) {
  const std::vector<Step> steps = StepsOf(map, part, depths);
  std::map<KeyframeId, double> variances;
  double sum = 0.0;
  for (size_t i = 0; i < part.size(); ++i) {
    const double excess = std::clamp(CommonChange(steps, i) - kPlausibleChange, 0.0, kMaxChange);
    sum += excess * excess * std::min(1.0, steps[i].duration_s / (2.0 * kSlipWindow_s));
    variances[part[i]] = sum;
  }
  return variances;
}

}  // namespace

MedianDepths MedianDepthsOf(const Map& map, std::span<const KeyframeId> part) {
  MedianDepths depths;
  for (const KeyframeId id : part) depths[id] = MedianDepth(map, *map.FindKeyframe(id));
  return depths;
}

std::vector<Matrix7> LinkCovariances(const Map& map, std::span<const KeyframeId> part,
                                     std::span<const KeyframePair> links, const MedianDepths& depths) {
  std::vector<Matrix7> covariances = LinkInformation(map, links);
  const bool has_scale = map.FindKeyframe(part.front())->features->calibration.sensor == SensorType::kMono;
  std::map<KeyframeId, double> slips;
  if (has_scale) slips = SlipVariances(map, part, depths);
  for (size_t i = 0; i < links.size(); ++i) {
    const auto [older, newer] = links[i];
    if (older == part.front() || newer == part.back()) {
      covariances[i].setZero();
      continue;
    }
    covariances[i] = BoundedInverse(covariances[i], depths.at(newer), has_scale);
    if (has_scale) covariances[i](6, 6) += slips.at(newer) - slips.at(older);
  }
  return covariances;
}

}  // namespace tessera
