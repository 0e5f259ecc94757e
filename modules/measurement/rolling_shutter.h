// A rolling shutter reads an image row after row, while the camera moves. The pose of a frame is the one at which its
// middle row was read; a keypoint of another row is moved to where the camera would have seen it from there.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "features/feature_types.h"
#include "geometry/rigid3.h"

namespace tessera {

// How a camera moves, in its own axes.
struct CameraMotion {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();   // units of the map / s
  Eigen::Vector3d turn_rate = Eigen::Vector3d::Zero();  // rad/s
};

// The steady motion that takes the camera to this pose relative to where it was, `interval_s` > 0 later.
CameraMotion MotionOver(const Rigid3& last_from_current, double interval_s);

// When a row is read, as a share of the readout (first row to last): -1/2 at the top of the image, 1/2 at its bottom.
inline double RowTime(const CameraCalibration& camera, double y_px) { return (y_px + 0.5) / camera.height_px - 0.5; }

// By how much the camera moves a point (in its frame) within one second, seen from the camera.
inline Eigen::Vector3d PointVelocity(const CameraMotion& motion, const Eigen::Vector3d& point_in_camera) {
  return motion.velocity + motion.turn_rate.cross(point_in_camera);
}

// The keypoints as they would be seen from the pose at the middle row:
//
//   point_in_middle = Exp(t turn_rate) point_in_row + t velocity,     t = readout_s * RowTime
//
// `depths`: of each keypoint (z, units of the map; 0: as good as infinite). Measured depths and disparities change
// along. Keypoints that would leave the surroundings of the image (IsNearImage) stay where they are.
FeatureFrame Unroll(const FeatureFrame& features, const std::vector<double>& depths, double readout_s,
                    const CameraMotion& motion);

}  // namespace tessera
