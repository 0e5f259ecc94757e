// A rolling shutter reads an image row after row, while the camera moves. The pose of a frame is the one at which its
// middle was read; a keypoint of another row is moved to where the camera would have seen it from there. The rows of a
// camera that stands on its side are columns of the image, and one that hangs upside down reads from the bottom.
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

// How long it takes to read an image, s: all rows from the top down, or all columns from left to right; below 0: from
// the bottom up, or from right to left.
struct Readout {
  double down_s = 0.0;
  double across_s = 0.0;

  bool is_rolling() const { return down_s != 0.0 || across_s != 0.0; }
  bool operator==(const Readout&) const = default;
};

// When a row or a column is read, as a share of the readout: -1/2 at the top or left edge of the image, 1/2 at the
// bottom or right.
inline double RowTime(const CameraCalibration& camera, double y_px) { return (y_px + 0.5) / camera.height_px - 0.5; }
inline double ColumnTime(const CameraCalibration& camera, double x_px) { return (x_px + 0.5) / camera.width_px - 0.5; }

// When a pixel is read, s after the middle of the image is.
inline double ReadTime(const Readout& readout, const CameraCalibration& camera, const Eigen::Vector2d& pixel) {
  return readout.down_s * RowTime(camera, pixel.y()) + readout.across_s * ColumnTime(camera, pixel.x());
}

// By how much the camera moves a point (in its frame) within one second, seen from the camera.
inline Eigen::Vector3d PointVelocity(const CameraMotion& motion, const Eigen::Vector3d& point_in_camera) {
  return motion.velocity + motion.turn_rate.cross(point_in_camera);
}

// The keypoints as they would be seen from the pose at the middle:
//
//   point_in_middle = Exp(t turn_rate) point_as_read + t velocity,     t = ReadTime
//
// `depths`: of each keypoint (z, units of the map; 0: as good as infinite). Measured depths and disparities change
// along. Keypoints that would leave the surroundings of the image (IsNearImage) stay where they are.
FeatureFrame Unroll(const FeatureFrame& features, const std::vector<double>& depths, const Readout& readout,
                    const CameraMotion& motion);

}  // namespace tessera
