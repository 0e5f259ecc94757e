// The camera as every stage behind the camera stage sees it: images are already undistorted and rectified, so it
// is a pinhole, and the right camera of a stereo pair looks along the same rows.
//
// Camera frame: x right, y down, z forward. Pixel (0, 0) is the center of the top left pixel.
//
//   u = fx x/z + cx,   v = fy y/z + cy                          [px]
//   u_right = u - fx * baseline / z                             [px]
#pragma once

#include <Eigen/Core>
#include <string>
#include <tuple>
#include <utility>

#include "core/result.h"

namespace tessera {

enum class SensorType { kMono = 0, kStereo = 1, kRgbd = 2 };

// "mono", "stereo", "rgbd"
std::string ToString(SensorType sensor);

struct CameraCalibration {
  SensorType sensor = SensorType::kMono;
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  double baseline_m = 0.0;    // stereo: distance from left to right camera; otherwise 0
  double depth_unit_m = 0.0;  // RGB-D: meters per count of the depth image; otherwise 0

  bool operator==(const CameraCalibration&) const = default;

  Result<> Check() const;

  // Pixel of a point in the camera frame; its z must be > 0.
  Eigen::Vector2d Project(const Eigen::Vector3d& point_in_camera) const {
    return {fx_px * point_in_camera.x() / point_in_camera.z() + cx_px,
            fy_px * point_in_camera.y() / point_in_camera.z() + cy_px};
  }
  // Ray through the pixel, scaled to z = 1.
  Eigen::Vector3d Ray(const Eigen::Vector2d& pixel) const {
    return {(pixel.x() - cx_px) / fx_px, (pixel.y() - cy_px) / fy_px, 1.0};
  }
};

// The focal lengths that a camera turns out to have, where they are others than its calibration says.
struct FocalLengths {
  double fx_px = 0.0;  // 0: as calibrated
  double fy_px = 0.0;

  bool is_known() const { return fx_px > 0.0; }
  bool operator==(const FocalLengths&) const = default;
};

// By which share a camera's focal length may differ from its calibration; beyond it, something else is wrong.
inline constexpr double kMaxFocalError = 0.03;

// By which share of the calibration's they differ from it; 0 where none are known.
inline double FocalError(const FocalLengths& focal, const CameraCalibration& calibration) {
  return focal.is_known() ? focal.fx_px / calibration.fx_px - 1.0 : 0.0;
}

// The calibration with these focal lengths; itself where none are known.
inline CameraCalibration WithFocal(CameraCalibration calibration, const FocalLengths& focal) {
  if (focal.is_known()) std::tie(calibration.fx_px, calibration.fy_px) = std::pair(focal.fx_px, focal.fy_px);
  return calibration;
}

}  // namespace tessera
