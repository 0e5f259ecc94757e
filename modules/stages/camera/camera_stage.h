// Wiring of the camera: a source of frames and poses in; CALIBRATION, GROUND_TRUTH, CAMERA, COLOR and END_OF_STREAM
// out. Which frame is sent when stands in datasets/camera_session.h.
#pragma once

#include "datasets/camera_session.h"
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
  void TellRightTurn();
  void TellEvents();
  void Do(const CameraActions& actions);

  StageContext& context_;
  CameraSession session_;
  size_t num_notes_told_ = 0;  // of the source's
  Publisher<CameraCalibration> calibration_;
  Publisher<GroundTruthPose> ground_truth_;
  Publisher<CameraFrame> frames_;
  Publisher<ColorFrame> colors_;
  Publisher<EndOfStream> end_of_stream_;
};

}  // namespace tessera
