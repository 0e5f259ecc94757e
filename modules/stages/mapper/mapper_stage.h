// Wiring of the mapper: keyframes in, changes of the map out; and the map for those who come late.
#pragma once

#include <optional>

#include "geometry/camera_frame.h"
#include "map/map_archive.h"
#include "stages/mapper/mapper.h"
#include "transport/stage.h"

namespace tessera {

class MapperStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit MapperStage(StageContext& context);

 private:
  void OnKeyframe(const KeyframeObservation& keyframe);
  void OnRequest(const MapRequest& request);
  void FinishIfDone();

  StageContext& context_;
  Mapper mapper_;
  MapArchive archive_;
  Publisher<MapDelta> deltas_;
  Publisher<MapSnapshotPage> pages_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<EndOfStream> tracker_end_;
};

}  // namespace tessera
