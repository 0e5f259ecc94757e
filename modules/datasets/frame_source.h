// Where frames come from: folders of data sets, videos, cameras.
//
// A frame keeps the number that it has in its source, also when only some frames are requested, so that frame
// 100 of a sequence is frame 100 in every run, log and table. The first frame of a source is frame 0; for a
// stereo or RGB-D source whose images are associated by time, pairs are counted.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "features/right_turn.h"
#include "geometry/camera_frame.h"

namespace tessera {

struct SourceOptions {
  std::string source;                     // kitti:DIR, euroc:DIR, tum:DIR, video:FILE, camera:N, rtsp://..., sim:NAME
  SensorType sensor = SensorType::kMono;  // mono uses the left images of a pair
  std::string calibration_path;           // YAML (calibration_file.h), instead of the source's; empty: the source's
  double depth_unit_m = 0.0;              // RGB-D: meters per count, instead of the source's; 0: the source's
  int64_t first_frame = 0;                // frames first_frame .. last_frame - 1 are wanted
  int64_t last_frame = -1;                // -1: to the end
  bool with_color = false;                // TakeColor() is called
  double min_focal_px = 0.0;              // images of a shorter focal length are doubled (doubled_source.h)
};

// Reads the color image of a frame when it is called, rectified as that frame is; empty if the image is gray. To be
// called while its source lives. Throws InputError as FrameSource::Next().
using ColorReader = std::function<ColorImage()>;

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // The camera of the frames: undistorted, rectified.
  virtual const CameraCalibration& calibration() const = 0;
  // The number of frames that Next() will return; nullopt if unknown.
  virtual std::optional<int64_t> num_frames() const = 0;
  // Known poses of the left rectified camera at the wanted frames, by frame number.
  virtual const std::vector<GroundTruthPose>& ground_truth() const = 0;
  // The next frame; nullopt at the end. Throws InputError at an image that is damaged or of another size.
  virtual std::optional<CameraFrame> Next() = 0;
  // Of the frame that Next() returned last; null if the source has no colors. To be called before the next Next(): most
  // frames never become keyframes, so that no color is decoded on the way.
  virtual ColorReader TakeColor() { return nullptr; }
  // Whether Next() has something to return, rather than to wait for.
  virtual bool HasNext() { return true; }
  // Frames below this number are no longer needed. A source that has to read them anyway returns them nonetheless.
  virtual void SkipTo(FrameId /*frame*/) {}
  // Whether frames come at their own pace and can't be delayed. Its times are those of its own clock, 0 where it has
  // none, and it ends where the connection does.
  virtual bool is_live() const = 0;
  // What happened to the connection since the last call, one sentence each.
  virtual std::vector<std::string> TakeEvents() { return {}; }
  // Notes for the user about how the source was read, one sentence each; more may come with each frame.
  virtual const std::vector<std::string>& notes() const = 0;
  // By how much the right camera of a pair was found to be turned against its calibration; right images are put
  // straight.
  virtual RightTurn right_turn() const { return {}; }
  // What is missing from the source, in one sentence; empty: nothing.
  virtual std::string loss() const { return ""; }
};

// "mono", "stereo" or "rgbd". Throws InputError.
SensorType ParseSensor(const std::string& text);

// Opens the source that the options name. Throws InputError with one sentence if it can't.
std::unique_ptr<FrameSource> OpenSource(const SourceOptions& options);

}  // namespace tessera
