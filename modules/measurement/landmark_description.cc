#include "measurement/landmark_description.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "features/pyramid.h"
#include "measurement/keypoint_measurement.h"

namespace tessera {
namespace {

constexpr size_t kConfirmingObservations = 3;
constexpr double kMaxKnownShare = 0.6;  // of the distance

Eigen::Vector3d MeanDirection(const Map& map, const Eigen::Vector3d& position_in_world,
                              std::span<const Observation> observations) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Observation& observation : observations) {
    const Eigen::Vector3d& camera_in_world = map.FindKeyframe(observation.keyframe)->world_from_camera.translation;
    sum += (camera_in_world - position_in_world).normalized();
  }
  return sum.normalized();
}

// How well the observations fix the position along the normal, the cameras' poses taken as exact.
double DepthInformation(const Map& map, const Landmark& landmark, std::span<const Observation> observations) {
  double information = 0.0;
  for (const Observation& observation : observations) {
    const Keyframe& keyframe = *map.FindKeyframe(observation.keyframe);
    information += DepthInformation(*keyframe.features, observation.keypoint, keyframe.world_from_camera, landmark);
  }
  return information;
}

// Of the newest kMaxDescriptors observations.
Descriptor Medoid(const Map& map, std::span<const Observation> observations) {
  const size_t num = std::min<size_t>(observations.size(), kMaxDescriptors);
  std::array<const Descriptor*, kMaxDescriptors> descriptors{};
  std::array<std::array<int, kMaxDescriptors>, kMaxDescriptors> distances{};
  for (size_t i = 0; i < num; ++i) {
    const auto& [keyframe, keypoint] = observations[observations.size() - num + i];
    descriptors[i] = &map.FindKeyframe(keyframe)->features->descriptors[Index(keypoint)];
    for (size_t j = 0; j < i; ++j) {
      distances[i][j] = distances[j][i] = HammingDistance(*descriptors[i], *descriptors[j]);
    }
  }
  size_t best = 0;
  int best_median = 257;
  for (size_t i = 0; i < num; ++i) {
    const auto begin = distances[i].begin(), middle = begin + static_cast<ptrdiff_t>((num - 1) / 2);
    std::nth_element(begin, middle, begin + static_cast<ptrdiff_t>(num));
    if (*middle < best_median) {
      best_median = *middle;
      best = i;
    }
  }
  return *descriptors[best];
}

}  // namespace

double DepthInformation(const FeatureFrame& features, int32_t keypoint, const Rigid3& world_from_camera,
                        const Landmark& landmark) {
  const CameraCalibration& camera = features.calibration;
  const Eigen::Matrix3d camera_from_world = world_from_camera.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d point = camera_from_world * (landmark.position_in_world - world_from_camera.translation);
  if (point.z() < kMinDepth) return 0.0;
  const Reprojection seen = Reproject(camera, Baseline(camera), point, SeenAt(features, keypoint));
  return (seen.by_point * (camera_from_world * landmark.normal)).squaredNorm();
}

double DepthSigma(double information, double distance) {
  return std::min(kMaxDepthShare * distance, 1.0 / std::sqrt(information));
}

Landmark DescribeInCamera(const FeatureFrame& features, int32_t keypoint, const Eigen::Vector3d& point_in_camera) {
  const auto i = static_cast<size_t>(keypoint);
  const double distance = point_in_camera.norm();
  Landmark landmark;
  landmark.position_in_world = point_in_camera;
  landmark.normal = -point_in_camera / distance;
  landmark.max_distance = distance * LevelScale(features.keypoints[i].level);
  landmark.min_distance = landmark.max_distance / LevelScale(kTopLevel);
  landmark.descriptor = features.descriptors[i];
  return landmark;
}

bool HasDepth(const Landmark& landmark, const Eigen::Vector3d& camera_in_world) {
  return landmark.depth_sigma <= kMaxKnownShare * (landmark.position_in_world - camera_in_world).norm();
}

Landmark DescribeMovedLandmark(const Map& map, LandmarkId id) {
  Landmark landmark = *map.FindLandmark(id);
  const std::span<const Observation> observations = map.ObservationsOf(id);
  landmark.normal = MeanDirection(map, landmark.position_in_world, observations);

  const Keyframe& newest = *map.FindKeyframe(observations.back().keyframe);
  const Keypoint& keypoint = newest.features->keypoints[Index(observations.back().keypoint)];
  const double distance = (newest.world_from_camera.translation - landmark.position_in_world).norm();
  landmark.depth_sigma = DepthSigma(DepthInformation(map, landmark, observations), distance);
  const bool has_depth = SeenAt(*newest.features, observations.back().keypoint).has_right();
  if (!has_depth && observations.size() < kConfirmingObservations) {
    landmark.depth_sigma = std::max(landmark.depth_sigma, kUnconfirmedShare * distance);
  }
  landmark.max_distance = distance * LevelScale(keypoint.level);
  landmark.min_distance = landmark.max_distance / LevelScale(kTopLevel);
  return landmark;
}

Landmark DescribeLandmark(const Map& map, LandmarkId id) {
  Landmark landmark = DescribeMovedLandmark(map, id);
  landmark.descriptor = Medoid(map, map.ObservationsOf(id));
  return landmark;
}

Landmark InWorld(const Sim3& world_from_keyframe, Landmark point) {
  point.position_in_world = world_from_keyframe * point.position_in_world;
  point.normal = world_from_keyframe.rotation * point.normal;
  point.depth_sigma *= world_from_keyframe.scale;
  point.min_distance *= world_from_keyframe.scale;
  point.max_distance *= world_from_keyframe.scale;
  return point;
}

}  // namespace tessera
