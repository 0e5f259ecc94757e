#include "tracking/delta_schedule.h"

namespace tessera {

bool DeltaSchedule::CanTrack(FrameId frame) const {
  for (const Sent& sent : awaited_) {
    if (!IsDue(sent, frame)) break;
    if (!held_.contains(sent.id)) return false;
  }
  return true;
}

std::vector<std::shared_ptr<const MapDelta>> DeltaSchedule::Take(FrameId frame) {
  std::vector<std::shared_ptr<const MapDelta>> deltas;
  while (!awaited_.empty() && IsDue(awaited_.front(), frame)) {
    auto held = held_.extract(awaited_.front().id);
    if (held.empty()) break;
    deltas.push_back(std::move(held.mapped()));
    awaited_.pop_front();
  }
  return deltas;
}

}  // namespace tessera
