// Wiring of the tracker: features in, poses and keyframes out.
#pragma once

#include <optional>

#include "geometry/camera_frame.h"
#include "tracking/tracker.h"
#include "transport/stage.h"

namespace tessera {

class TrackerStage {
 public:
  explicit TrackerStage(StageContext& context);

 private:
  void OnFeatures(const FeatureFrame& features);
  void FinishIfDone();

  StageContext& context_;
  Tracker tracker_;
  Publisher<PoseEstimate> poses_;
  Publisher<KeyframeObservation> keyframes_;
  Publisher<EndOfStream> end_of_stream_;
  FrameId last_frame_;
  std::optional<EndOfStream> features_end_;
};

}  // namespace tessera
