// Wiring of the camera: a source of frames on one side, CALIBRATION, GROUND_TRUTH, CAMERA and END_OF_STREAM
// on the other. One frame is read ahead, so that decoding it delays nobody.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "datasets/frame_source.h"
#include "datasets/pacer.h"
#include "datasets/renumbering.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class CameraStage {
 public:
  // Opens the source that the settings name. Throws InputError if it can't.
  explicit CameraStage(StageContext& context);
  // Told to stop before the source's end, the stream ends here.
  ~CameraStage();
  CameraStage(const CameraStage&) = delete;
  CameraStage& operator=(const CameraStage&) = delete;

 private:
  bool Step();
  void ReadNext();
  void SkipTracked();
  void SendNext();
  void SendGroundTruthUpTo(FrameId frame);
  void End();
  void WatchPoses();

  StageContext& context_;
  std::unique_ptr<FrameSource> source_;
  Pacer pacer_;
  Renumbering renumbering_;  // of a live source
  Publisher<CameraCalibration> calibration_;
  Publisher<GroundTruthPose> ground_truth_;
  Publisher<CameraFrame> frames_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<CameraFrame> next_;  // read and not yet sent
  size_t num_truths_sent_ = 0;
  int64_t num_sent_ = 0;
  FrameId last_sent_;
  FrameId tracked_;  // this frame, and all before it, have a pose
  int64_t tracked_utime_us_ = 0;
  int64_t last_progress_us_ = 0;  // when a frame was last sent or a pose last came
  bool has_ended_ = false;
  bool warned_ = false;
};

}  // namespace tessera
