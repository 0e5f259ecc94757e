// Textured images for tests that need features but no data set, and a scene that a stereo camera passes.
#pragma once

#include <algorithm>
#include <random>

#include "core/image.h"
#include "geometry/camera_frame.h"

namespace tessera {

// Random bright and dark rectangles on a mid-gray ground, repeatable by seed.
inline GrayImage RectanglesImage(int width, int height, unsigned seed) {
  GrayImage image(width, height, 100);
  std::mt19937 generator(seed);
  const auto below = [&](int bound) { return static_cast<int>(generator() % static_cast<unsigned>(bound)); };
  for (int i = 0; i < width * height / 400; ++i) {
    const int x0 = below(width), y0 = below(height);
    const int x1 = std::min(width, x0 + 4 + below(24)), y1 = std::min(height, y0 + 4 + below(24));
    const auto intensity = static_cast<uint8_t>(below(256));
    for (int y = y0; y < y1; ++y) std::fill(image.row(y) + x0, image.row(y) + x1, intensity);
  }
  return image;
}

// A stereo camera that moves sideways along two walls, the upper one far and the lower one near; shifts are whole
// pixels, so that every image is exact.
class MovingScene {
 public:
  static constexpr int kWidth = 320, kHeight = 240;
  static constexpr int kFarShift = 2, kNearShift = 4;  // px a frame
  static constexpr int kStepsPerBaseline = 4;  // so the disparities are 8 and 16 px, the walls 7.5 and 3.75 m off

  // Walls long enough for steps 0 .. max_steps.
  explicit MovingScene(int max_steps = kMaxFrames)
      : far_(RectanglesImage(TextureWidth(max_steps), kHeight / 2, 1)),
        near_(RectanglesImage(TextureWidth(max_steps), kHeight / 2, 2)) {}

  static CameraCalibration Calibration() {
    return {.sensor = SensorType::kStereo,
            .width_px = kWidth,
            .height_px = kHeight,
            .fx_px = 300,
            .fy_px = 300,
            .cx_px = 160,
            .cy_px = 120,
            .baseline_m = kBaselineM};
  }
  CameraFrame Frame(int64_t id) const { return Frame(id, static_cast<int>(id)); }
  // What the camera sees after `step` steps.
  CameraFrame Frame(int64_t id, int step) const {
    CameraFrame frame;
    frame.id = {id};
    frame.utime_us = 100'000 * id;
    frame.sensor = SensorType::kStereo;
    frame.left = Picture(step);
    frame.right = Picture(step + kStepsPerBaseline);
    return frame;
  }
  static constexpr double kBaselineM = 0.2;
  static constexpr double kStepM = kBaselineM / kStepsPerBaseline;  // sideways, between two frames
  static constexpr int kMaxFrames = 60;

 private:
  static constexpr int TextureWidth(int max_steps) { return kWidth + kNearShift * (max_steps + kStepsPerBaseline); }

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
