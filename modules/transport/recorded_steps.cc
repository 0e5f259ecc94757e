#include "transport/recorded_steps.h"

#include "core/errors.h"
#include "transport/channels.h"
#include "transport/codec.h"
#include "transport/log_file.h"

namespace tessera {

RecordedSteps ReadRecordedSteps(const std::string& path, const std::string& channel_prefix) {
  RecordedSteps recorded;
  LogFileReader file(path);
  ValueJoiner<PoseEstimate> joiner;
  for (LogEvent event; file.Next(&event);) {
    if (event.channel != channel_prefix + kPoseChannel.name) continue;
    const auto header = ReadHeader(event.data);
    if (!header || joiner.Add(event.data, *header) != ValueJoiner<PoseEstimate>::Result::kComplete) {
      throw InputError("log " + path + " holds a damaged message on " + event.channel + ": record it again");
    }
    const PoseEstimate& pose = joiner.value();
    recorded.steps[pose.frame] = pose.num_deltas;
    recorded.is_live |= pose.is_live;
  }
  return recorded;
}

}  // namespace tessera
