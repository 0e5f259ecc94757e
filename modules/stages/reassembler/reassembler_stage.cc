#include "stages/reassembler/reassembler_stage.h"

#include <string>
#include <utility>

#include "features/selection.h"
#include "messages/tracking_types.h"

namespace tessera {
namespace {

// Frames that wait for tiles; more than that means that the dispatcher's flow control failed.
constexpr int kMaxOpenFrames = 64;
// One that was started again hears of frames one by one; a larger step is none of this pipeline.
constexpr int64_t kMaxFramesAhead = 100'000;

}  // namespace

ReassemblerStage::ReassemblerStage(StageContext& context) : context_(context), assembler_(kMaxOpenFrames) {
  features_ = context.Advertise(kFeatures);
  acks_ = context.Advertise(kTileAck);
  end_of_stream_ = context.Advertise(kEndOfStream);
  context.Subscribe(kTileFeatures, [this](TileFeatures tile) { OnTile(std::move(tile)); });
  // One that was started again goes on behind what is tracked.
  context.Subscribe(kPose, [this](const PoseEstimate& pose) -> Result<> {
    const FrameId last = assembler_.last_released();
    if (last.valid() && pose.frame.value > last.value + kMaxFramesAhead) {
      return Failed("its frame " + std::to_string(pose.frame.value) + " is far beyond " + std::to_string(last.value) +
                    ", the last one released");
    }
    assembler_.SkipTo(pose.frame);
    Release();
    return {};
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kDispatcher) {
      dispatcher_end_ = end;
      FinishIfDone();
    }
  });
  acks_.Publish({.frame = {0}, .tiles = {}, .wants_all = false, .lowest_priority = {}});  // nothing is here yet
}

void ReassemblerStage::OnTile(TileFeatures tile) {
  if (tile.run != context_.epoch_us()) {
    // An extractor of a pool finished what an earlier run had asked of it.
    context_.SetValue("answers_of_other_runs", static_cast<double>(++num_of_other_runs_));
    return;
  }
  if (const Result<> checked = CheckTileFeatures(tile); !checked) {
    context_.ReportError("candidates of frame " + std::to_string(tile.frame.value) + ", tile " +
                         std::to_string(tile.tile) + " are refused: " + checked.error().sentence);
    return;
  }
  const FrameId frame = tile.frame;
  const int32_t number = tile.tile;
  const FrameAssembler::Result added = assembler_.Add(std::move(tile));
  if (added == FrameAssembler::Result::kRefused) {
    context_.ReportError("tile " + std::to_string(number) + " of frame " + std::to_string(frame.value) +
                         " contradicts the tiles that came before it, or too many frames are open: it is refused");
    return;
  }
  // Acknowledged also when repeated: the first acknowledgement may be what was late.
  const bool wants_all = added == FrameAssembler::Result::kTooFew;
  acks_.Publish({.frame = frame, .tiles = {number}, .wants_all = wants_all, .lowest_priority = {}});
  Release();
}

void ReassemblerStage::Release() {
  while (assembler_.CanRelease()) {
    std::optional<Selection> selection;
    {
      const StepTimer timer(context_);
      selection = assembler_.ReleaseNext();
    }
    if (!selection) break;
    features_.Publish(selection->features);
    if (selection->lowest_priority.empty()) continue;
    acks_.Publish({.frame = selection->features.frame,
                   .tiles = {},
                   .wants_all = false,
                   .lowest_priority = std::move(selection->lowest_priority)});
  }
  for (const TileAck& forgotten : assembler_.TakeForgotten()) acks_.Publish(forgotten);
  context_.SetQueue(assembler_.num_open_frames());
  FinishIfDone();
}

void ReassemblerStage::FinishIfDone() {
  if (context_.finished() || !dispatcher_end_ || assembler_.last_released().value + 1 < dispatcher_end_->num_frames) {
    return;
  }
  end_of_stream_.Publish({.stage = StageKind::kReassembler,
                          .num_frames = dispatcher_end_->num_frames,
                          .num_dropped = dispatcher_end_->num_dropped});
  context_.Finish();
}

}  // namespace tessera
