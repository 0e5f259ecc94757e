// Cameras as they are before undistortion and rectification.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace tessera {

// Pinhole with radial-tangential distortion (Brown's model in OpenCV's form).
// With x = X/Z, y = Y/Z, r2 = x^2 + y^2:
//
//   c  = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
//   u  = fx (x c + 2 p1 x y + p2 (r2 + 2 x^2)) + cx           [px]
//   v  = fy (y c + p1 (r2 + 2 y^2) + 2 p2 x y) + cy           [px]
struct PinholeCamera {
  int width_px = 0;  // 0: as the images are
  int height_px = 0;
  double fx_px = 0.0;
  double fy_px = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
  std::vector<double> distortion;  // k1 k2 p1 p2 [k3 [k4 k5 k6]]; empty: none

  // Fails if a value is out of range.
  Result<> Check() const;
};

// One camera, or a pair.
struct CameraRig {
  PinholeCamera left;
  std::optional<PinholeCamera> right;  // stereo
  Rigid3 right_from_left;              // stereo: meters
  double depth_unit_m = 0.0;           // RGB-D: meters per count; 0: unknown

  // Fails if something that this kind of sensor needs is missing or out of range.
  Result<> Check(SensorType sensor) const;
};

// A pair that is rectified already: the same pinhole twice, `baseline_m` apart.
CameraRig RectifiedPair(const PinholeCamera& camera, double baseline_m);

// Whether a matrix that somebody typed or printed is a rotation, up to the digits that got lost on the way.
bool IsRotation(const Eigen::Matrix3d& matrix);

}  // namespace tessera
