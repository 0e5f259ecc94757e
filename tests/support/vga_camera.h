// A camera of 640x480 pixels, for tests that need no particular one.
#pragma once

#include "geometry/camera.h"

namespace tessera {

inline CameraCalibration VgaCamera(SensorType sensor) {
  return {.sensor = sensor, .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240};
}

}  // namespace tessera
