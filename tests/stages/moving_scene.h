// A stereo camera that moves sideways along two walls, the upper one far and the lower one near; shifts are whole
// pixels, so that every image is exact.
#pragma once

#include <algorithm>

#include "core/image.h"
#include "geometry/camera_frame.h"
#include "stages/synthetic_image.h"

namespace tessera {

class MovingScene {
 public:
  static constexpr int kWidth = 320, kHeight = 240;
  static constexpr int kFarShift = 3, kNearShift = 6;  // px a frame; the disparities are twice as large

  MovingScene() : far_(RectanglesImage(kTexture, kHeight / 2, 1)), near_(RectanglesImage(kTexture, kHeight / 2, 2)) {}

  static CameraCalibration Calibration() {
    return {.sensor = SensorType::kStereo,
            .width_px = kWidth,
            .height_px = kHeight,
            .fx_px = 300,
            .fy_px = 300,
            .cx_px = 160,
            .cy_px = 120,
            .baseline_m = 0.2};
  }
  // The camera moves by half a baseline, 0.1 m, between two frames.
  CameraFrame Frame(int64_t id) const {
    CameraFrame frame;
    frame.id = {id};
    frame.utime_us = 100'000 * id;
    frame.sensor = SensorType::kStereo;
    frame.left = Picture(static_cast<int>(id));
    frame.right = Picture(static_cast<int>(id) + 2);
    return frame;
  }
  static constexpr double kStepM = 0.1;
  static constexpr int kMaxFrames = 60;

 private:
  static constexpr int kTexture = kWidth + kNearShift * (kMaxFrames + 2);

  GrayImage Picture(int step) const {
    GrayImage image(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      const bool is_far = y < kHeight / 2;
      const uint8_t* row = (is_far ? far_ : near_).row(y % (kHeight / 2)) + step * (is_far ? kFarShift : kNearShift);
      std::copy(row, row + kWidth, image.row(y));
    }
    return image;
  }

  GrayImage far_, near_;
};

}  // namespace tessera
