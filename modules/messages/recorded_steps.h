// What the POSEs of a recorded run say about its schedule: which step of the map each frame was tracked with.
#pragma once

#include <cstdint>
#include <map>

#include "core/ids.h"
#include "messages/loop_types.h"

namespace tessera {

struct RecordedSteps {
  std::map<FrameId, int64_t> steps;           // deltas that the map had seen, by frame; empty: the log holds no POSE
  std::map<FrameId, FrameId> relocalized_by;  // by frame, where one was
  std::map<FrameId, RelocalizationAnswer> relocalizations;  // by the frame that asked: those that were used
  bool has_drops = false;  // frames of the log did not reach the tracker: only those with a step did
  bool is_live = false;    // the steps are what happened to be there: a replay must follow them
};

}  // namespace tessera
