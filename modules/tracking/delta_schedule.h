// The law of logical time for a follower of the map: at frame f it uses exactly the deltas that answer keyframes of
// frames <= f - D. What comes early is held back; what is missing must be waited for.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "core/ids.h"
#include "map/map.h"

namespace tessera {

class DeltaSchedule {
 public:
  // D >= 1, in frames.
  explicit DeltaSchedule(int64_t map_delay_frames) : delay_frames_(map_delay_frames) {}

  // A keyframe went out while frame `at` was tracked. Keyframes must come in the order of their ids.
  void KeyframeSent(KeyframeId id, FrameId at) { awaited_.push_back({id, at}); }
  // A delta came in; each answers one keyframe.
  void Receive(std::shared_ptr<const MapDelta> delta) { held_[delta->answers] = std::move(delta); }

  // Whether all deltas that frame `frame` must see are there.
  bool CanTrack(FrameId frame) const;
  // Takes out the deltas that frame `frame` sees and no frame before it saw, in order. CanTrack(frame) must hold.
  std::vector<std::shared_ptr<const MapDelta>> Take(FrameId frame);

 private:
  struct Sent {
    KeyframeId id;
    FrameId at;
  };
  bool IsDue(const Sent& sent, FrameId frame) const { return sent.at.value <= frame.value - delay_frames_; }

  const int64_t delay_frames_;
  std::deque<Sent> awaited_;
  std::map<KeyframeId, std::shared_ptr<const MapDelta>> held_;
};

}  // namespace tessera
