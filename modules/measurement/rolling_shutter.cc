#include "measurement/rolling_shutter.h"

#include "geometry/reprojection.h"

namespace tessera {

CameraMotion MotionOver(const Rigid3& last_from_current, double interval_s) {
  return {last_from_current.translation / interval_s, LogSO3(last_from_current.rotation) / interval_s};
}

FeatureFrame Unroll(const FeatureFrame& features, const std::vector<double>& depths, const Readout& readout,
                    const CameraMotion& motion) {
  FeatureFrame unrolled = features;
  const CameraCalibration& camera = features.calibration;
  for (size_t i = 0; i < unrolled.keypoints.size(); ++i) {
    Keypoint& keypoint = unrolled.keypoints[i];
    const Eigen::Vector2d pixel(keypoint.x_px, keypoint.y_px);
    const double time_s = ReadTime(readout, camera, pixel);
    Eigen::Vector3d point = ExpSO3(time_s * motion.turn_rate) * camera.Ray(pixel);
    if (depths[i] > 0.0) point += time_s / depths[i] * motion.velocity;
    if (point.z() < kMinDepth) continue;
    Keypoint moved = keypoint;
    const Eigen::Vector2d moved_pixel = camera.Project(point);
    moved.x_px = static_cast<float>(moved_pixel.x());
    moved.y_px = static_cast<float>(moved_pixel.y());
    moved.depth_m *= static_cast<float>(point.z());
    if (keypoint.right_x_px >= 0.0F) {
      moved.right_x_px = moved.x_px - (keypoint.x_px - keypoint.right_x_px) / static_cast<float>(point.z());
    }
    if (IsNearImage(moved, camera)) keypoint = moved;
  }
  return unrolled;
}

}  // namespace tessera
