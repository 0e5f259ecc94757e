// What the POSEs of a recorded run say about its schedule: which step of the map each frame was tracked with.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/ids.h"

namespace tessera {

struct RecordedSteps {
  std::map<FrameId, int64_t> steps;  // deltas that the map had seen, by frame; empty: the log holds no POSE
  bool is_live = false;              // the steps are what happened to be there: a replay must follow them
};

// Throws InputError: no such file, not an LCM log, cut in the middle, a POSE that makes no sense.
RecordedSteps ReadRecordedSteps(const std::string& path, const std::string& channel_prefix);

}  // namespace tessera
