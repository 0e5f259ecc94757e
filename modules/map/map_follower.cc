#include "map/map_follower.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tessera {

void MapFollower::Receive(Delta delta) {
  // What follows a snapshot that is on its way may have a number that was given out before.
  if (delta->number < next_delta_ && !needs_snapshot_) return;
  if (delta->number == next_delta_ && !needs_snapshot_) {
    lacks_start_ = false;
    collected_.reset();
  }
  const int64_t number = delta->number;
  waiting_.try_emplace(number, std::move(delta));
  // The last one goes: the one that closes the gap must always find room.
  if (waiting_.size() > kMaxWaiting) waiting_.erase(std::prev(waiting_.end()));
}

void MapFollower::Receive(const MapSnapshotPage& page) {
  if (!Request()) return;  // somebody else's
  if (page.page == 0 && (!collected_ || page.part.number > collected_->whole.number)) {
    if (page.part.number < next_delta_ && !needs_snapshot_) return;
    collected_ = Collected{page.num_pages, 0, page.part};
  } else if (!collected_ || page.page != collected_->next_page || page.num_pages != collected_->num_pages ||
             page.part.number != collected_->whole.number) {
    return;
  } else {
    AppendPage(page, &collected_->whole);
  }
  if (++collected_->next_page == collected_->num_pages) Complete();
}

const MapDelta* MapFollower::BegunSnapshot() const {
  return collected_ && collected_->next_page == 1 ? &collected_->whole : nullptr;
}

void MapFollower::ReceiveRest(MapDelta whole) {
  collected_->whole = std::move(whole);
  Complete();
}

void MapFollower::Complete() {
  snapshot_ = std::make_shared<const MapDelta>(std::move(collected_->whole));
  collected_.reset();
  num_known_ = std::max(num_known_, next_delta_);  // what was given out exists, and no news may come to tell of it
  next_delta_ = snapshot_->number + 1;
  waiting_.erase(waiting_.begin(), waiting_.lower_bound(next_delta_));
  needs_snapshot_ = false;
  lacks_start_ = false;
}

std::vector<MapFollower::Delta> MapFollower::Take() {
  std::vector<Delta> deltas;
  if (needs_snapshot_) return deltas;
  if (snapshot_ != nullptr) deltas.push_back(std::exchange(snapshot_, nullptr));
  for (auto it = waiting_.begin(); it != waiting_.end() && it->first == next_delta_; it = waiting_.erase(it)) {
    deltas.push_back(std::move(it->second));
    ++next_delta_;
  }
  return deltas;
}

std::optional<MapRequest> MapFollower::Request() const {
  if (collected_) return MapRequest{next_delta_, collected_->whole.number, collected_->next_page};
  if (needs_snapshot_) return MapRequest{};
  const bool has_gap = next_delta_ < num_known_ || (!waiting_.empty() && waiting_.begin()->first > next_delta_);
  if (has_gap || lacks_start_) return MapRequest{.next_delta = next_delta_};
  return std::nullopt;
}

// While what answers a request comes in, one after the other, the next one is missing each time; each request for it
// would be answered by many.
bool MapFollower::IsAnsweredSoon(const MapRequest& request) const {
  if (!asked_) return false;
  if (request == *asked_) return true;
  const int32_t num_pages_come = request.page - asked_->page;
  const bool are_pages = request.snapshot >= 0 && request.snapshot == asked_->snapshot;
  if (are_pages) return num_pages_come > 0 && num_pages_come < MapRequest::kMaxPages;
  const bool are_deltas = request.snapshot < 0 && asked_->snapshot < 0 && asked_->next_delta >= 0;
  const int64_t num_come = request.next_delta - asked_->next_delta;
  return are_deltas && num_come > 0 && num_come < MapRequest::kMaxDeltas;
}

std::optional<MapRequest> MapFollower::TakeRequest() {
  const std::optional<MapRequest> request = Request();
  if (request && IsAnsweredSoon(*request)) return std::nullopt;
  asked_ = request;
  return request;
}

}  // namespace tessera
