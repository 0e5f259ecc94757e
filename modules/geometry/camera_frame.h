// What a source yields and the CAMERA channel carries: all images of one moment, and what is known about them.
#pragma once

#include <cstdint>
#include <string>

#include "core/ids.h"
#include "core/image.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"

namespace tessera {

// One frame: undistorted, rectified images of one size (the calibration's).
struct CameraFrame {
  FrameId id;
  int64_t utime_us = 0;  // when it was taken, by the source's clock
  SensorType sensor = SensorType::kMono;
  GrayImage left;    // the only image of a mono or RGB-D camera
  GrayImage right;   // stereo only
  DepthImage depth;  // RGB-D only, registered to `left`

  bool operator==(const CameraFrame&) const = default;
};

// True pose of the left camera at a frame, where the source knows it.
struct GroundTruthPose {
  FrameId frame;
  int64_t utime_us = 0;
  Rigid3 world_from_camera;  // metres; any world frame
};

// The stage `stage` has sent all it will ever send: the last frame of the stream is num_frames - 1 (the first need not
// be 0: frames keep their source's numbers), and of all that came to it, it and those before it dropped some.
struct EndOfStream {
  std::string stage;
  int64_t num_frames = 0;
  int64_t num_dropped = 0;
  int64_t num_values = 0;  // tracker: keyframes sent; mapper: deltas sent. Others wait for the last; the rest: 0
};

}  // namespace tessera
