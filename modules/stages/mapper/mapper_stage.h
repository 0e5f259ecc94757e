// Wiring of the mapper: keyframes, loops and global adjustments in, changes of the map out; and the map for those who
// come late. Keyframes wait here until what must bend the map before them is there.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "map/map_archive.h"
#include "map/removed_keyframes.h"
#include "mapping/correction_schedule.h"
#include "mapping/mapper.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class MapperStage {
 public:
  // Throws InputError if a setting makes no sense.
  explicit MapperStage(StageContext& context);

 private:
  void Load(const std::string& path);
  void OnKeyframe(const KeyframeObservation& keyframe);
  void OnRequest(const MapRequest& request);
  void ProcessWaiting();
  void Publish(MapDelta&& delta);
  void FinishIfDone();

  StageContext& context_;
  Mapper mapper_;
  const bool closes_loops_;
  CorrectionSchedule schedule_;
  KeyframeId next_keyframe_{0};  // the next to come
  std::deque<KeyframeObservation> waiting_;
  int64_t num_processed_ = 0;  // keyframes
  MapArchive archive_;
  KeyframePoses places_;
  Publisher<MapDelta> deltas_;
  Publisher<MapSnapshotPage> pages_;
  Publisher<RemovedInDelta> removed_;
  Publisher<EndOfStream> end_of_stream_;
  std::optional<EndOfStream> tracker_end_;
};

}  // namespace tessera
