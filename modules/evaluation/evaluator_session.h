// What the evaluator does with everything that the stages say: it goes into the record of the run, and it decides when
// that is complete (run_end.h). No bus, and the time is told. The record is to be written once: when the run has ended,
// or when the process is told to stop before.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "core/result.h"
#include "evaluation/run_end.h"
#include "evaluation/run_record.h"
#include "messages/stage_messages.h"

namespace tessera {

class EvaluatorSession {
 public:
  // `own_name`: of the evaluator's stage. `with_color`: the camera tells each keyframe's color, or that it has none.
  EvaluatorSession(std::string own_name, bool with_color) : with_color_(with_color), end_(std::move(own_name)) {}

  // `publish_us`: the tracker's wall clock when it published the pose.
  // Fails if no source can have so many frames by now.
  Result<> Receive(const PoseEstimate& pose, int64_t publish_us, int64_t now_us);
  // The next change of the map; fails as Map::Apply does.
  Result<> Receive(const MapDelta& delta) { return record_.ApplyDelta(delta); }
  // One that was started again begins with a snapshot of the map, which does not hold all that poses are relative to.
  void Receive(const RemovedInDelta& removed);
  void Receive(const ColorFrame& color) { record_.AddColor(color); }
  void Receive(const GroundTruthPose& truth) { record_.AddGroundTruth(truth); }
  // Fails if there were more frames than it says.
  Result<> Receive(const EndOfStream& end, int64_t now_us);
  void Receive(const StageStatus& status, int64_t now_us);
  // The map has changed, or has to be replaced by a snapshot.
  void NoteMap(bool needs_snapshot, int64_t now_us);

  // Whether the run has ended and its record is not written yet.
  bool MustWrite(int64_t now_us) { return !is_written_ && end_.IsReached(now_us) && HasColors(now_us); }
  // Whether there is something to write if nothing more comes: a run that never began leaves no files.
  bool MayWrite() const { return !is_written_ && (!record_.empty() || end_.has_tracker_ended()); }
  const Map& map() const { return record_.map(); }
  // The record, to be written now; also where that fails, it is not tried again.
  const RunRecord& TakeRecord();

  // Colors that have not come for so long after all else won't come any more: the camera was killed meanwhile.
  static constexpr int64_t kMaxWaitForColorsUs = 5'000'000;

 private:
  bool HasColors(int64_t now_us);

  const bool with_color_;
  RunRecord record_;
  RunEnd end_;
  FrameId last_pose_;
  std::optional<int64_t> lacks_colors_us_;  // since when they alone are missing
  bool is_written_ = false;
};

}  // namespace tessera
