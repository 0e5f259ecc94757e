// Cameras as they are before undistortion and rectification.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace tessera {

// What a lens makes of the direction x = X/Z, y = Y/Z. With r = sqrt(x^2 + y^2):
//
// Radial-tangential (Brown's model in OpenCV's form):
//   c  = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
//   u  = fx (x c + 2 p1 x y + p2 (r^2 + 2 x^2)) + cx          [px]
//   v  = fy (y c + p1 (r^2 + 2 y^2) + 2 p2 x y) + cy          [px]
//
// Equidistant, for fisheye lenses (J. Kannala, S. Brandt, "A Generic Camera Model and Calibration Method for
// Conventional, Wide-Angle, and Fish-Eye Lenses", PAMI 2006), with t = atan(r):
//   c  = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) / r
//   u  = fx x c + cx                                          [px]
//   v  = fy y c + cy                                          [px]
enum class LensModel { kRadialTangential, kEquidistant };

// By the names that EuRoC, Kalibr and ROS have for it, such as "radial-tangential" and "equidistant"; nullopt: another.
std::optional<LensModel> ParseLensModel(const std::string& name);

struct PinholeCamera {
  int width_px = 0;  // 0: as the images are
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  std::vector<double> distortion;  // k1 k2 p1 p2 [k3 [k4 k5 k6]]; empty: none. Equidistant: k1 k2 k3 k4
  LensModel lens = LensModel::kRadialTangential;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// One camera, or a pair.
struct CameraRig {
  PinholeCamera left;
  std::optional<PinholeCamera> right;    // stereo
  Rigid3 right_from_left;                // stereo: meters
  double depth_unit_m = 0.0;             // RGB-D: meters per count; 0: unknown
  std::optional<Rigid3> body_from_left;  // where the calibration says it: the body is what ground truth tells poses of

  // Fails if something that this kind of sensor needs is missing or out of range.
  Result<> Check(SensorType sensor) const;
};

// A pair that is rectified already: the same pinhole twice, `baseline_m` apart.
CameraRig RectifiedPair(const PinholeCamera& camera, double baseline_m);

// Whether a matrix that somebody typed or printed is a rotation, up to the digits that got lost on the way.
bool IsRotation(const Eigen::Matrix3d& matrix);

}  // namespace tessera
