// Wiring of an extractor: one job in, its candidates out.
#pragma once

#include "features/extractor.h"
#include "transport/stage.h"

namespace tessera {

class ExtractorStage {
 public:
  explicit ExtractorStage(StageContext& context);

 private:
  void OnJob(const TileJob& job);
  void SayReady();

  StageContext& context_;
  Extractor extractor_;
  Publisher<TileFeatures> features_;
  Publisher<ExtractorReady> ready_;
  int64_t num_jobs_done_ = 0;
};

}  // namespace tessera
