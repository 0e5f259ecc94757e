#include "wire/recorded_steps.h"

#include <set>

#include "core/errors.h"
#include "messages/topics.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {

RecordedSteps ReadRecordedSteps(const std::string& path, const std::string& channel_prefix) {
  RecordedSteps recorded;
  LogFileReader file(path);
  ValueJoiner<PoseEstimate> poses;
  ValueJoiner<RelocalizationAnswer> answers;
  ValueJoiner<EndOfStream> ends;
  // The value that the event completes; null if it doesn't.
  const auto join = [&](auto& joiner, const LogEvent& event) {
    const auto header = ReadHeader(event.data);
    const auto value = header ? joiner.Add(event.data, *header) : Failed("it has no header");
    if (!value) throw InputError("log " + path + " holds a damaged message on " + event.channel + ": record it again");
    return *value;
  };
  for (LogEvent event; file.Next(&event);) {
    if (event.channel == channel_prefix + kRelocalization.name) {
      if (const RelocalizationAnswer* answer = join(answers, event)) recorded.relocalizations[answer->frame] = *answer;
    } else if (event.channel == channel_prefix + kEndOfStream.name) {
      const EndOfStream* end = join(ends, event);
      if (end != nullptr && end->stage == StageKind::kTracker) recorded.has_drops = end->num_dropped > 0;
    } else if (event.channel == channel_prefix + kPose.name) {
      const PoseEstimate* pose = join(poses, event);
      if (pose == nullptr) continue;
      recorded.steps[pose->frame] = pose->num_deltas;
      if (pose->relocalized_by.valid()) recorded.relocalized_by[pose->frame] = pose->relocalized_by;
      recorded.is_live |= pose->is_live;
    }
  }
  std::set<FrameId> used;
  for (const auto& [frame, asked] : recorded.relocalized_by) used.insert(asked);
  std::erase_if(recorded.relocalizations, [&](const auto& answer) { return !used.contains(answer.first); });
  return recorded;
}

}  // namespace tessera
