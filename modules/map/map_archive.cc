#include "map/map_archive.h"

#include <algorithm>
#include <utility>

namespace tessera {

void MapArchive::Begin(const Map& map) { snapshots_.push_back(map.Snapshot()); }

void MapArchive::Add(std::shared_ptr<const MapDelta> delta, const Map& map, std::optional<int64_t> awaited) {
  const int64_t number = delta->number;
  deltas_.push_back(std::move(delta));
  if (!snapshots_.empty() && (number + 1) % kSnapshotInterval != 0) return;
  snapshots_.push_back(map.Snapshot());
  if (snapshots_.size() <= 2) return;
  while (snapshots_.size() > 2 && (!awaited || snapshots_[1].number < *awaited)) snapshots_.pop_front();
  // Only the first one is handed out. Of those that have to wait for that, the last two will do: each has all
  // landmarks.
  while (snapshots_.size() > 3) snapshots_.erase(snapshots_.begin() + 1);
  while (deltas_.front()->number <= snapshots_.front().number) deltas_.pop_front();
}

MapArchive::Answer MapArchive::AnswerTo(const MapRequest& request, const Map& map) {
  Answer answer;
  if (map.next_delta() == 0) return answer;
  if (request.snapshot >= 0) {
    const auto has_number = [&](const MapDelta& snapshot) { return snapshot.number == request.snapshot; };
    const auto held = std::find_if(snapshots_.begin(), snapshots_.end(), has_number);
    // One that is gone is replaced by a newer one, from its beginning.
    const int32_t num_pages = held == snapshots_.end() ? 0 : NumSnapshotPages(*held);
    if (request.page < 0 || request.page >= num_pages) {
      answer.pages.push_back(CutSnapshotPage(snapshots_.front(), 0));
      return answer;
    }
    const int32_t end = std::min(num_pages, request.page + MapRequest::kMaxPages);
    for (int32_t page = request.page; page < end; ++page) answer.pages.push_back(CutSnapshotPage(*held, page));
    return answer;
  }
  const int64_t first_kept = deltas_.empty() ? map.next_delta() : deltas_.front()->number;
  if (request.next_delta < first_kept || request.next_delta > map.next_delta()) {
    answer.pages.push_back(CutSnapshotPage(snapshots_.front(), 0));
    return answer;
  }
  for (const auto& delta : deltas_) {
    if (delta->number < request.next_delta || delta->number >= request.next_delta + MapRequest::kMaxDeltas) continue;
    answer.deltas.push_back(delta);
  }
  return answer;
}

}  // namespace tessera
