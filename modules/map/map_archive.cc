#include "map/map_archive.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace tessera {
namespace {

// After a long wait for an answer the map that is handed out is far behind, and is not to catch up in a single step.
constexpr int kMaxFollowed = 8;

}  // namespace

void MapArchive::Add(std::shared_ptr<const MapDelta> delta, std::optional<int64_t> awaited) {
  deltas_.push_back(std::move(delta));
  FollowOwner(awaited);
  const auto is_left = [this](const Snapshot& snapshot) {
    return newest() - snapshot.whole.number > 2 * kDelay && newest() - snapshot.asked > kDelay;
  };
  std::erase_if(snapshots_, is_left);
  int64_t oldest = old_map_.next_delta() - 1;
  if (!snapshots_.empty()) oldest = std::min(oldest, snapshots_.front().whole.number);
  while (deltas_.front()->number < oldest) deltas_.pop_front();
}

void MapArchive::FollowOwner(std::optional<int64_t> awaited) {
  const int64_t last = std::min(newest() - kDelay, awaited.value_or(newest()) - 1);
  for (int i = 0; i < kMaxFollowed; ++i) {
    const int64_t next = old_map_.next_delta();
    if (next > std::max<int64_t>(last, 0)) return;
    const auto& delta = deltas_[static_cast<size_t>(next - deltas_.front()->number)];
    ThrowIfFailed<std::logic_error>(old_map_.Apply(*delta), "map archive: ");
  }
}

MapSnapshotPage MapArchive::FirstPage() {
  const bool is_recent = !snapshots_.empty() && (snapshots_.back().whole.number == old_map_.next_delta() - 1 ||
                                                 newest() - snapshots_.back().whole.number <= 2 * kDelay);
  if (!is_recent) snapshots_.push_back({old_map_.Snapshot(), 0});
  snapshots_.back().asked = newest();
  return CutSnapshotPage(snapshots_.back().whole, 0);
}

MapArchive::Answer MapArchive::AnswerTo(const MapRequest& request) {
  Answer answer;
  if (newest() < 0) return answer;
  if (request.snapshot >= 0) {
    const auto has_number = [&](const Snapshot& snapshot) { return snapshot.whole.number == request.snapshot; };
    const auto held = std::find_if(snapshots_.begin(), snapshots_.end(), has_number);
    // One that is gone is replaced by a newer one, from its beginning.
    const int32_t num_pages = held == snapshots_.end() ? 0 : NumSnapshotPages(held->whole);
    if (request.page < 0 || request.page >= num_pages) {
      answer.pages.push_back(FirstPage());
      return answer;
    }
    held->asked = newest();
    const int32_t end = std::min(num_pages, request.page + MapRequest::kMaxPages);
    for (int32_t page = request.page; page < end; ++page) answer.pages.push_back(CutSnapshotPage(held->whole, page));
    return answer;
  }
  const int64_t first_kept = deltas_.empty() ? newest() + 1 : deltas_.front()->number;
  if (request.next_delta < first_kept || request.next_delta > newest() + 1) {
    answer.pages.push_back(FirstPage());
    return answer;
  }
  for (const auto& delta : deltas_) {
    if (delta->number < request.next_delta || delta->number >= request.next_delta + MapRequest::kMaxDeltas) continue;
    answer.deltas.push_back(delta);
  }
  return answer;
}

}  // namespace tessera
