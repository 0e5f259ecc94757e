// A data set on disk, opened but not yet rectified: what the readers of the single formats (KITTI, EuRoC,
// TUM) make, and RecordedSource plays.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/image.h"
#include "datasets/camera_rig.h"
#include "datasets/frame_source.h"

namespace tessera {

// The images of one camera by number, to be read in ascending order.
class ImageReader {
 public:
  virtual ~ImageReader() = default;
  virtual int64_t num_images() const = 0;
  // Throws InputError if the image is missing or damaged.
  virtual GrayImage Read(int64_t index) = 0;
  // The colors of the image that was read last, to be decoded later; null if they can't be.
  virtual ColorReader ColorOfLast() = 0;
  // Its file, and its index there if the file holds several; for messages.
  virtual std::string Name(int64_t index) const = 0;
};

std::unique_ptr<ImageReader> ReadImageFiles(std::vector<std::string> paths);
// The images of a video. `num_images`: how many to read if the container doesn't store their number.
std::unique_ptr<ImageReader> ReadVideoImages(const std::string& path, int64_t num_images);

struct Recording {
  std::vector<int64_t> utimes_us;             // by frame
  std::string times_path;                     // the file that lists them
  std::unique_ptr<ImageReader> left;          // at least as many images as utimes_us
  std::unique_ptr<ImageReader> right;         // stereo
  std::vector<std::string> depth_paths;       // RGB-D: by frame; empty: it has none
  std::vector<int64_t> depth_delays_us;       // RGB-D: by frame, CameraFrame::depth_delay_us
  CameraRig rig;                              // image size may be 0: unknown
  std::vector<GroundTruthPose> ground_truth;  // of the left camera before rectification; by frame
  std::vector<std::string> notes;
};

// Each reads the format's files but not yet the images. They throw InputError.
Recording LoadKitti(const std::string& folder, const SourceOptions& options);
Recording LoadEuroc(const std::string& folder, const SourceOptions& options);
Recording LoadTum(const std::string& folder, const SourceOptions& options);

// Plays the recording. Throws InputError if the wanted frames are not in it, times do not increase, or the
// first image doesn't fit.
std::unique_ptr<FrameSource> PlayRecording(Recording recording, const SourceOptions& options);

// Throws InputError unless `folder` is a folder with something in it.
void RequireFolder(const std::string& folder);

}  // namespace tessera
