// Wiring of the dispatcher: frames in, jobs out to extractors. What happens between them stands in
// distribution/dispatcher_session.h.
#pragma once

#include <map>

#include "distribution/dispatcher_session.h"
#include "runtime/stage.h"

namespace tessera {

class DispatcherStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit DispatcherStage(StageContext& context);

 private:
  void SubscribeAll();
  void GiveWork();

  StageContext& context_;
  const bool packs_tiles_;
  DispatcherSession session_;
  std::map<int, Publisher<TileJob>> tiles_;  // by extractor
  Publisher<EndOfStream> end_of_stream_;
  int64_t num_dropped_told_ = 0;
};

}  // namespace tessera
