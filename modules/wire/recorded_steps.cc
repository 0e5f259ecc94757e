#include "wire/recorded_steps.h"

#include <set>

#include "core/errors.h"
#include "messages/channels.h"
#include "wire/codec.h"
#include "wire/log_file.h"

namespace tessera {

RecordedSteps ReadRecordedSteps(const std::string& path, const std::string& channel_prefix) {
  RecordedSteps recorded;
  LogFileReader file(path);
  ValueJoiner<PoseEstimate> poses;
  ValueJoiner<RelocalizationAnswer> answers;
  const auto is_complete = [&](auto& joiner, const LogEvent& event) {
    using Result = typename std::remove_reference_t<decltype(joiner)>::Result;
    const auto header = ReadHeader(event.data);
    const Result result = header ? joiner.Add(event.data, *header) : Result::kRefused;
    if (result != Result::kRefused) return result == Result::kComplete;
    throw InputError("log " + path + " holds a damaged message on " + event.channel + ": record it again");
  };
  for (LogEvent event; file.Next(&event);) {
    if (event.channel == channel_prefix + kRelocalizationChannel.name && is_complete(answers, event)) {
      recorded.relocalizations[answers.value().frame] = answers.value();
    }
    if (event.channel != channel_prefix + kPoseChannel.name || !is_complete(poses, event)) continue;
    const PoseEstimate& pose = poses.value();
    recorded.steps[pose.frame] = pose.num_deltas;
    if (pose.relocalized_by.valid()) recorded.relocalized_by[pose.frame] = pose.relocalized_by;
    recorded.is_live |= pose.is_live;
  }
  std::set<FrameId> used;
  for (const auto& [frame, asked] : recorded.relocalized_by) used.insert(asked);
  std::erase_if(recorded.relocalizations, [&](const auto& answer) { return !used.contains(answer.first); });
  return recorded;
}

}  // namespace tessera
