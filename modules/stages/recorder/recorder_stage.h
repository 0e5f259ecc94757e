// Wiring of the recorder: everything on all buses into one LCM log.
#pragma once

#include "transport/stream_recorder.h"

namespace tessera {

class RecorderStage {
 public:
  explicit RecorderStage(StageContext& context);

 private:
  StreamRecorder recorder_;
};

}  // namespace tessera
