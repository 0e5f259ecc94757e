// Calibration files that users write for their cameras (`--camera FILE.yaml`), such as config/cameras/example.yaml.
//
//   width_px: 752                  # image size; optional: that of the first image
//   height_px: 480
//   fx_px: 458.654                 # pinhole
//   fy_px: 457.296
//   cx_px: 367.215
//   cy_px: 248.375
//   distortion: [k1, k2, p1, p2]   # 4, 5 or 8 numbers; optional
//   distortion_model: equidistant  # a fisheye lens: k1 k2 k3 k4; else radial-tangential (camera_rig.h)
//   depth_unit_m: 0.001            # RGB-D: meters per count of the depth image
//   baseline_m: 0.54               # stereo, images rectified already: distance of the cameras; if they are not:
//   right:                         # the right camera: fx_px, fy_px, cx_px, cy_px, distortion ..., and
//     right_from_left: [...]       #   12 numbers, [R | t] row by row, t in meters: x_right = R x_left + t
#pragma once

#include <string>

#include "datasets/camera_rig.h"

namespace tessera {

// Reads such a file, or one that Kalibr or ROS wrote (foreign_calibration.h). Throws InputError with file and key if a
// key is unknown, missing or out of range.
CameraRig LoadCalibrationFile(const std::string& path);

}  // namespace tessera
