// What a source yields and the CAMERA channel carries: all images of one moment, and what is known about them.
#pragma once

#include <cstdint>

#include "core/ids.h"
#include "core/image.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace tessera {

// One frame: undistorted, rectified images of one size (the calibration's).
struct CameraFrame {
  FrameId id;
  int64_t utime_us = 0;  // when it was taken, by the source's clock
  int64_t age_us = 0;  // how long ago that is, when it leaves the camera process: to measure latency, no result uses it
  int64_t depth_delay_us = 0;  // RGB-D: by how much later `depth` was taken, as far as the source knows
  SensorType sensor = SensorType::kMono;
  GrayImage left;    // the only image of a mono or RGB-D camera
  GrayImage right;   // stereo only
  DepthImage depth;  // RGB-D only, registered to `left`

  bool operator==(const CameraFrame&) const = default;
};

// The left image of a frame in color, for people: features and the map are made of `CameraFrame::left`.
struct ColorFrame {
  FrameId id;
  int64_t utime_us = 0;  // as CameraFrame's
  ColorImage image;      // undistorted and rectified as that; empty: there is none

  bool operator==(const ColorFrame&) const = default;
};

// True pose of the left camera at a frame, where the source knows it.
struct GroundTruthPose {
  FrameId frame;
  int64_t utime_us = 0;
  Rigid3 world_from_camera;  // meters; any world frame
};

}  // namespace tessera
