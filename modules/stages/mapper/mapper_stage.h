// Wiring of the mapper: keyframes, loops, global adjustments and requests in; changes of the map out. What happens
// between them stands in mapping/mapper_session.h.
#pragma once

#include "core/rate_limit.h"
#include "mapping/mapper_session.h"
#include "runtime/stage.h"

namespace tessera {

class MapperStage {
 public:
  // Throws InputError if a setting makes no sense, or the map to begin with can't be read.
  explicit MapperStage(StageContext& context);

 private:
  template <class Value>
  void Receive(const Topic<Value>& topic);
  bool IsAnswered(const MapRequest& request, int64_t arrival_us) const;
  void Advance();
  void Do(const MapperActions& actions);

  struct Answered {
    MapRequest request;
    int64_t arrival_us = 0;
  };

  StageContext& context_;
  RateLimit answering_;  // requests of followers, who ask again
  Answered answered_;    // the last one
  MapperSession session_;
  Publisher<MapDelta> deltas_;
  Publisher<MapSnapshotPage> pages_;
  Publisher<RemovedInDelta> removed_;
  Publisher<EndOfStream> end_of_stream_;
};

}  // namespace tessera
