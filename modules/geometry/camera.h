// The camera as every stage behind the camera stage sees it: images are already undistorted and rectified, so it
// is a pinhole, and the right camera of a stereo pair looks along the same rows.
//
// Camera frame: x right, y down, z forward. Pixel (0, 0) is the center of the top left pixel.
//
//   u = fx x/z + cx,   v = fy y/z + cy                          [px]
//   u_right = u - fx * baseline / z                             [px]
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <string>
#include <tuple>
#include <utility>

#include "core/result.h"

namespace tessera {

enum class SensorType { kMono = 0, kStereo = 1, kRgbd = 2 };

// "mono", "stereo", "rgbd"
std::string ToString(SensorType sensor);

// By how much the columns of a stereo pair's right image were moved to the right, since they turned out to stand beside
// where the calibration has them. With x, y from the image's center to the right and down, in halves of its width:
//
//   center + across x + down y + bend x^2                                                            [px]
//
// A camera that is turned by a small angle about its y axis (it squints) has center and bend, about its z axis down.
struct RightShift {
  double center_px = 0.0, across_px = 0.0, down_px = 0.0, bend_px = 0.0;

  bool operator==(const RightShift&) const = default;
  bool is_zero() const { return *this == RightShift{}; }
};

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
  // By which share points at the image's left or right edge were moved away from the center, since the images turned
  // out to be distorted (MovedByLens). 0: they stand where they were seen.
  double radial = 0.0;
  RightShift right_shift;  // of a stereo pair

  bool operator==(const CameraCalibration&) const = default;

  Result<> Check() const;

  // What sizes in the image are shares of, where it must not matter how the camera stands.
  int longer_side_px() const { return std::max(width_px, height_px); }

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

// What a camera turns out to have, where that is other than its calibration says.
struct LensCorrection {
  double fx_px = 0.0;  // focal lengths; 0: as calibrated
  double fy_px = 0.0;
  double radial = 0.0;  // as CameraCalibration::radial
  RightShift right_shift;

  bool is_known() const { return fx_px > 0.0; }
  bool operator==(const LensCorrection&) const = default;
};

// By which share a camera's focal length may differ from its calibration; beyond it, something else is wrong.
inline constexpr double kMaxFocalError = 0.03;
// Likewise CameraCalibration::radial, either way.
inline constexpr double kMaxRadial = 0.03;
// Likewise each number of RightShift: a right camera that squints by half a degree, or is turned by that.
inline constexpr double kMaxRightShift_px = 8.0;

// By which share of the calibration's focal lengths those of the correction differ; 0 where none are known.
inline double FocalError(const LensCorrection& lens, const CameraCalibration& calibration) {
  return lens.is_known() ? lens.fx_px / calibration.fx_px - 1.0 : 0.0;
}

// The calibration with this correction; itself where none is known.
inline CameraCalibration WithLens(CameraCalibration calibration, const LensCorrection& lens) {
  if (!lens.is_known()) return calibration;
  std::tie(calibration.fx_px, calibration.fy_px, calibration.radial, calibration.right_shift) =
      std::tuple(lens.fx_px, lens.fy_px, lens.radial, lens.right_shift);
  return calibration;
}

// Of the column at which the right image shows what the left one shows at `pixel`.
double RightShiftAt(const CameraCalibration& calibration, const Eigen::Vector2d& pixel);

// Where a pixel stands in an image whose distortion is corrected by `radial`, with r = |pixel - center| over half the
// image's width:
//
//   moved - center = (1 + radial r^2) (pixel - center)
Eigen::Vector2d MovedByLens(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& pixel);
// The inverse, for what lies within two half widths.
Eigen::Vector2d BeforeLens(const CameraCalibration& calibration, double radial, const Eigen::Vector2d& moved);

}  // namespace tessera
