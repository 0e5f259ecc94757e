// Recorded LCM logs as a source: the typed values of a camera's channels, whole and in order.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "geometry/camera_frame.h"
#include "messages/end_of_stream.h"

namespace tessera {

using LoggedValue = std::variant<CameraCalibration, GroundTruthPose, CameraFrame, EndOfStream>;

// Reads CALIBRATION, GROUND_TRUTH, CAMERA, COLOR and the camera's END_OF_STREAM of one log, recorded by any means:
// messages that were recorded out of order or twice are put right by their numbers, parts are joined. A value that
// lacks a part is left out, since stock recorders ask for nothing again.
class LogReader {
 public:
  // Looks through the whole log at once, so that a damaged one is refused before anything is played. Throws
  // InputError: no such file, not an LCM log, cut in the middle, other bytes than its checksums say, no whole frame in
  // it, two recordings.
  explicit LogReader(const std::string& path, const std::string& channel_prefix = "");
  ~LogReader();

  // The next value, in recorded order; nullopt at the end. Throws InputError if it makes no sense.
  std::optional<LoggedValue> Next();

  // Whether there is anything on COLOR.
  bool has_colors() const;
  // The color of a frame, which may stand anywhere in the log; empty if there is none. Frames must be asked for in
  // ascending order. Throws as above.
  ColorImage ColorOf(FrameId frame);

  // Whole frames in the log.
  int64_t num_frames() const;
  // How many frames are whole if not all are, in a sentence; else empty.
  std::string loss() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
