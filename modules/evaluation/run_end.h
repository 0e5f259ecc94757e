// Decides when the record of a run is complete: the tracker and the mapper have ended, all poses, the whole map and all
// that left it are there, and every stage has given the figures that it has after that. Not a session of its own: no
// bus, and the time is told.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "core/ids.h"
#include "messages/end_of_stream.h"

namespace tessera {

class RunEnd {
 public:
  // `own_name`: of the stage that asks, which need not report to itself.
  explicit RunEnd(std::string own_name) : own_name_(std::move(own_name)) {}

  // The tracker or the mapper has ended. Returns whether that is new; other stages' ends don't matter.
  bool NoteEnd(const EndOfStream& end, int64_t now_us);
  void NotePose(FrameId frame, int64_t now_us);
  // The replica has all deltas below `next_delta`; -1: it has to be replaced.
  void NoteMap(int64_t next_delta, int64_t now_us);
  // What delta `delta`, and those before it, removed is known.
  void NoteRemoved(int64_t delta);
  // The stage `name` told its figures.
  void NoteStatus(const std::string& name, int64_t now_us) { heard_us_[name] = now_us; }

  // Whether the tracker has ended; before, there is nothing that a run could be judged by but its poses.
  bool has_tracker_ended() const { return tracker_end_.has_value(); }
  // Whether the record is complete, or what is missing won't come any more.
  bool IsReached(int64_t now_us);

  // Each stage tells its figures twice a second; one that was silent for so long before the end is not waited for.
  static constexpr int64_t kMaxWaitForStatusUs = 1'000'000;
  // After the tracker's end, a pose or a change of the map that has not come for this long won't come any more; a
  // global bundle adjustment of a large map takes a minute on a busy machine.
  static constexpr int64_t kLastNewsTimeoutUs = 120'000'000;

 private:
  bool HasAll(int64_t now_us) const;
  bool HaveAllReported() const;

  const std::string own_name_;
  std::optional<EndOfStream> tracker_end_, mapper_end_;
  FrameId last_pose_;
  int64_t next_delta_ = 0;
  int64_t num_removals_known_ = 0;           // what deltas below this number removed is known
  int64_t last_news_us_ = 0;                 // when the last pose, change of the map or end came
  std::optional<int64_t> complete_us_;       // when everything was there
  std::map<std::string, int64_t> heard_us_;  // by stage: when its last status came
};

}  // namespace tessera
