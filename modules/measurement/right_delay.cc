#include "measurement/right_delay.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMaxParting_px = 1.0;
constexpr double kMinBase = 0.2;  // of the baseline; the rays of cameras that stand nearer tell no depth

}  // namespace

double RightColumnRate(const CameraCalibration& camera, const Eigen::Vector3d& point_in_left,
                       const CameraMotion& motion) {
  const Eigen::Vector3d velocity = PointVelocity(motion, point_in_left);
  const double column = (point_in_left.x() - camera.baseline_m) / point_in_left.z();
  return -camera.fx_px * (velocity.x() - column * velocity.z()) / point_in_left.z();
}

FeatureFrame WithRightColumnsOfImage(const FeatureFrame& features, double delay_s, const CameraMotion& motion) {
  FeatureFrame moved = features;
  const CameraCalibration& camera = features.calibration;
  const Rigid3 later_from_now = Rigid3{ExpSO3(delay_s * motion.turn_rate), delay_s * motion.velocity}.Inverse();
  const Eigen::Vector3d base = Eigen::Vector3d(camera.baseline_m, 0.0, 0.0) - later_from_now.translation;
  for (Keypoint& keypoint : moved.keypoints) {
    if (keypoint.right_x_px < 0.0F) continue;
    const Eigen::Vector3d ray =
        later_from_now.rotation * camera.Ray({static_cast<double>(keypoint.x_px), static_cast<double>(keypoint.y_px)});
    const double column = (static_cast<double>(keypoint.right_x_px) - camera.cx_px) / camera.fx_px;
    const double across = base.x() - column * base.z();
    const double inverse_depth = (ray.x() - column * ray.z()) / across;
    const double disparity_px = camera.fx_px * camera.baseline_m * inverse_depth;
    if (across < kMinBase * camera.baseline_m || disparity_px < -kMaxParting_px) {
      keypoint.right_x_px = -1.0F;
    } else {
      keypoint.right_x_px = keypoint.x_px - static_cast<float>(std::max(0.0, disparity_px));
    }
  }
  return moved;
}

}  // namespace tessera
