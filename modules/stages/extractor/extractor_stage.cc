#include "stages/extractor/extractor_stage.h"

#include "features/tiling.h"
#include "geometry/camera_frame.h"

namespace tessera {

ExtractorStage::ExtractorStage(StageContext& context) : context_(context) {
  features_ = context.Advertise<TileFeatures>(kTileFeaturesChannel, Publishers::kMany);
  ready_ = context.Advertise<ExtractorReady>(kExtractorReadyChannel, Publishers::kMany);
  context.Subscribe<TileJob>(TileChannel(context.id()), [this](const TileJob& job, const MessageInfo&) { OnJob(job); });
  context.Subscribe<EndOfStream>(kEndOfStreamChannel, [this](const EndOfStream& end, const MessageInfo&) {
    if (end.stage == "dispatcher") context_.Finish();
  });
  context.Every(std::chrono::milliseconds(400), [this] { SayReady(); });
}

void ExtractorStage::OnJob(const TileJob& job) {
  if (const std::string problem = CheckTileJob(job); !problem.empty()) {
    context_.ReportError("job for frame " + std::to_string(job.frame.value) + ", tile " + std::to_string(job.tile) +
                         " is refused: " + problem);
    return;
  }
  TileFeatures features;
  {
    const StepTimer timer(context_);
    features = extractor_.Extract(job);
  }
  features_.Publish(features);
  ++num_jobs_done_;
}

void ExtractorStage::SayReady() {
  ready_.Publish({.extractor = context_.id(), .epoch_us = context_.epoch_us(), .num_jobs_done = num_jobs_done_});
}

}  // namespace tessera
