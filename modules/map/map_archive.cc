#include "map/map_archive.h"

#include <algorithm>
#include <utility>

namespace tessera {

void MapArchive::Add(std::shared_ptr<const MapDelta> delta) {
  deltas_.push_back(std::move(delta));
  if (deltas_.size() > kMaxDeltas) deltas_.pop_front();
}

MapArchive::Answer MapArchive::AnswerTo(const MapRequest& request, const Map& map) {
  Answer answer;
  if (deltas_.empty()) return answer;
  if (request.snapshot >= 0) {
    const auto held = std::find_if(snapshots_.begin(), snapshots_.end(),
                                   [&](const MapDelta& snapshot) { return snapshot.number == request.snapshot; });
    // One that is gone is replaced by a newer one, from its beginning.
    const bool is_there = held != snapshots_.end() && request.page >= 0 && request.page < NumSnapshotPages(*held);
    answer.page = is_there ? CutSnapshotPage(*held, request.page) : CutSnapshotPage(NewSnapshot(map), 0);
  } else if (request.next_delta < deltas_.front()->number || request.next_delta > map.next_delta()) {
    answer.page = CutSnapshotPage(NewSnapshot(map), 0);
  } else {
    std::copy_if(deltas_.begin(), deltas_.end(), std::back_inserter(answer.deltas),
                 [&](const auto& delta) { return delta->number >= request.next_delta; });
  }
  return answer;
}

const MapDelta& MapArchive::NewSnapshot(const Map& map) {
  if (snapshots_.empty() || snapshots_.back().number + 1 != map.next_delta()) {
    snapshots_.push_back(map.Snapshot());
    if (snapshots_.size() > kMaxSnapshots) snapshots_.pop_front();
  }
  return snapshots_.back();
}

}  // namespace tessera
