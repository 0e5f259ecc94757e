#include "measurement/landmark_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "measurement/landmark_description.h"

namespace tessera {

std::vector<double> LandmarkDepths(const Map& map, const Keyframe& keyframe) {
  const Rigid3 camera_from_world = keyframe.world_from_camera.Inverse();
  std::vector<double> depths;
  for (const LandmarkId id : keyframe.landmarks) {
    if (!id.valid()) continue;
    const Landmark& landmark = *map.FindLandmark(id);
    const double z = (camera_from_world * landmark.position_in_world).z();
    if (z > 0.0 && HasDepth(landmark, keyframe.world_from_camera.translation)) depths.push_back(z);
  }
  std::sort(depths.begin(), depths.end());
  return depths;
}

double MedianDepth(const Map& map, const Keyframe& keyframe) {
  const std::vector<double> depths = LandmarkDepths(map, keyframe);
  return depths.empty() ? 1.0 : depths[depths.size() / 2];
}

FeatureGrid MakeGrid(const FeatureFrame& features) {
  return {features.keypoints, features.calibration.width_px, features.calibration.height_px};
}

bool IsInImage(const CameraCalibration& camera, const Eigen::Vector2d& pixel_px) {
  return pixel_px.x() >= 0.0 && pixel_px.x() < camera.width_px && pixel_px.y() >= 0.0 &&
         pixel_px.y() < camera.height_px;
}

View::View(const CameraCalibration& camera, const Rigid3& world_from_camera) : calibration(camera) {
  const Rigid3 camera_from_world = world_from_camera.Inverse();
  rotation = camera_from_world.rotation.toRotationMatrix();
  translation = camera_from_world.translation;
  camera_in_world = world_from_camera.translation;
}

std::optional<ExpectedView> Expect(const View& view, const Landmark& landmark) {
  const Eigen::Vector3d point = view.rotation * landmark.position_in_world + view.translation;
  if (!(point.z() > 0.0)) return std::nullopt;
  ExpectedView expected;
  expected.pixel_px = view.calibration.Project(point);
  if (!IsInImage(view.calibration, expected.pixel_px)) return std::nullopt;
  const Eigen::Vector3d to_camera = view.camera_in_world - landmark.position_in_world;
  expected.depth = point.z();
  expected.distance = to_camera.norm();
  if (expected.distance < 0.8 * landmark.min_distance || expected.distance > 1.2 * landmark.max_distance) {
    return std::nullopt;
  }
  expected.cos_angle = to_camera.dot(landmark.normal) / expected.distance;
  if (expected.cos_angle < 0.5) return std::nullopt;
  // The lowest level at which the patch is no finer than it was: 1.2^level >= max_distance / distance.
  while (expected.level < kTopLevel && LevelScale(expected.level) * expected.distance < landmark.max_distance) {
    ++expected.level;
  }
  return expected;
}

PixelObservation SeenAt(const FeatureFrame& features, int32_t keypoint, const Landmark& landmark,
                        const Eigen::Vector3d& camera_in_world) {
  PixelObservation seen = SeenAt(features, keypoint);
  const double px_per_rad = AsideSigmaPxPerRad(features.calibration.sensor);
  if (px_per_rad > 0.0) {
    const Eigen::Vector3d to_camera = (camera_in_world - landmark.position_in_world).normalized();
    const double aside_px = LevelScale(features.keypoints[static_cast<size_t>(keypoint)].level) * px_per_rad *
                            (to_camera - landmark.normal).norm();
    seen.sigma_px = std::hypot(seen.sigma_px, aside_px);
  }
  return seen;
}

uint8_t RollBetween(const Rigid3& second_from_first) {
  const Eigen::Matrix3d r = second_from_first.rotation.toRotationMatrix();
  const double roll_rad = std::atan2(r(1, 0) - r(0, 1), r(0, 0) + r(1, 1));
  return static_cast<uint8_t>(std::lround(roll_rad / (2.0 * std::numbers::pi) * 256.0) & 255);
}

}  // namespace tessera
