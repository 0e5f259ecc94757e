// Reads the schedule of a recorded run from its log.
#pragma once

#include <string>

#include "messages/recorded_steps.h"

namespace tessera {

// Throws InputError: no such file, not an LCM log, cut in the middle, a POSE that makes no sense.
RecordedSteps ReadRecordedSteps(const std::string& path, const std::string& channel_prefix);

}  // namespace tessera
