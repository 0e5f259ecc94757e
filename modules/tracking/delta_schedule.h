// When a follower of the map applies which delta. The law of logical time: at frame f it uses exactly the deltas that
// answer keyframes of frames <= f - D. What comes early is held back; what is missing must be waited for. A robot that
// must not wait takes what is there instead, and notes the step; a replay follows the noted steps.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <variant>
#include <vector>

#include "core/ids.h"
#include "map/map.h"

namespace tessera {

class DeltaSchedule {
 public:
  using Delta = std::shared_ptr<const MapDelta>;
  // How many deltas had been applied when a frame was tracked.
  using Steps = std::map<FrameId, int64_t>;

  // By logical time; D >= 1, in frames.
  explicit DeltaSchedule(int64_t map_delay_frames) : rule_(Delayed{map_delay_frames}) {}
  // All that is there, never waiting.
  static DeltaSchedule Live() { return DeltaSchedule(Rule(LiveRule{})); }
  // As it went once. A frame without a step takes none; where fewer deltas are made than then, all of them will do.
  static DeltaSchedule Recorded(Steps steps) { return DeltaSchedule(Rule(std::move(steps))); }

  // A keyframe went out while frame `at` was tracked. Keyframes must come in the order of their ids.
  void KeyframeSent(KeyframeId id, FrameId at);
  // The next delta came in (MapFollower puts them in order). One that is held already changes nothing.
  void Receive(Delta delta);
  // A snapshot was applied, in place of all deltas up to its number; those after it will be received (again).
  void SkipTo(const MapDelta& snapshot);

  bool follows_logical_time() const { return std::holds_alternative<Delayed>(rule_); }
  // Whether all deltas that frame `frame` must see are there.
  bool CanTrack(FrameId frame) const;
  // Takes out the deltas that frame `frame` sees and no frame before it saw, in order. CanTrack(frame) must hold.
  std::vector<Delta> Take(FrameId frame);

 private:
  struct Delayed {
    int64_t frames = 1;
  };
  struct LiveRule {};
  using Rule = std::variant<Delayed, LiveRule, Steps>;
  struct Sent {
    KeyframeId id;
    FrameId at;
  };
  explicit DeltaSchedule(Rule rule) : rule_(std::move(rule)) {}

  KeyframeId LastDue(FrameId frame, int64_t delay_frames) const;
  bool IsDue(const MapDelta& delta, FrameId frame) const;

  Rule rule_;
  std::deque<Sent> sent_;  // keyframes that no frame was late enough for yet
  KeyframeId past_due_;    // the last keyframe before those
  KeyframeId last_sent_;
  std::deque<Delta> held_;
  int64_t next_delta_ = 0;  // number of the one that Receive() expects
  KeyframeId answered_;     // by the last delta received
};

}  // namespace tessera
