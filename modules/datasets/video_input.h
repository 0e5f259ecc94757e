// Images out of video files, V4L2 devices and network streams.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/image.h"
#include "datasets/frame_source.h"

namespace tessera {

class VideoInput {
 public:
  // Each throws InputError if it can't be opened.
  static VideoInput OpenFile(const std::string& path);
  // Device /dev/video<index>; a size of 0 leaves the device's own.
  static VideoInput OpenDevice(int index, int width_px, int height_px);
  static VideoInput OpenUrl(const std::string& url);

  VideoInput(VideoInput&&) noexcept;
  ~VideoInput();

  // The next image; nullopt at the end.
  std::optional<GrayImage> Read();
  // The colors of the image that Read() returned last; null if it has one channel.
  ColorReader ColorOfLast() const;
  // Passes over the next image; false at the end.
  bool Skip();

  // Number of images according to the container; 0: unknown.
  int64_t num_images() const;
  // Images per second; 0: unknown.
  double frames_per_s() const;
  // Time of the last image by the stream's own clock, milliseconds; 0: unknown.
  double position_ms() const;

 private:
  struct Impl;
  explicit VideoInput(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
