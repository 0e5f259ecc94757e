// Wiring of the dispatcher: frames in, jobs out to extractors. The rules are in work_queue.h.
#pragma once

#include <map>
#include <optional>
#include <set>

#include "geometry/camera_frame.h"
#include "stages/dispatcher/work_queue.h"
#include "transport/stage.h"

namespace tessera {

class DispatcherStage {
 public:
  explicit DispatcherStage(StageContext& context);

 private:
  void OnFrame(const CameraFrame& frame, const MessageInfo& info);
  void OnCalibration(const CameraCalibration& calibration);
  void QueueFrame(const CameraFrame& frame, int64_t arrival_us);
  void GiveWork();
  void Watch();
  void FinishIfDone();

  StageContext& context_;
  WorkQueue queue_;
  std::map<int, Publisher<TileJob>> tiles_;  // by extractor
  Publisher<EndOfStream> end_of_stream_;
  std::optional<CameraCalibration> calibration_;
  std::vector<std::pair<CameraFrame, int64_t>> before_calibration_;  // frames that overtook it, with their arrival
  std::optional<EndOfStream> source_end_;
  FrameId newest_;  // highest frame number that came
  int64_t num_dropped_ = 0;
  int64_t last_activity_us_ = 0;  // when the last frame came
  bool warned_no_extractor_ = false;
};

}  // namespace tessera
