// Wiring of the reassembler: candidates of tiles in, features of whole frames out.
#pragma once

#include <optional>

#include "distribution/frame_assembler.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class ReassemblerStage {
 public:
  explicit ReassemblerStage(StageContext& context);

 private:
  void OnTile(TileFeatures tile);
  void Release();
  void FinishIfDone();

  StageContext& context_;
  FrameAssembler assembler_;
  Publisher<FeatureFrame> features_;
  Publisher<TileAck> acks_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<EndOfStream> dispatcher_end_;
  int64_t num_of_other_runs_ = 0;  // answers that were passed over
};

}  // namespace tessera
