// A stage's subscription to the map: MAP_DELTA and MAP_SNAPSHOT in, MAP_REQUEST out when something is missing. How a
// follower catches up stands in map/map_follower.h.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "map/map_follower.h"
#include "runtime/stage.h"

namespace tessera {

class MapSubscription {
 public:
  // `joins_late`: the map may be there already. `on_deltas` is called when there may be something to Take().
  MapSubscription(StageContext& context, bool joins_late, std::function<void()> on_deltas);
  MapSubscription(const MapSubscription&) = delete;
  MapSubscription& operator=(const MapSubscription&) = delete;

  std::vector<MapFollower::Delta> Take() { return follower_.Take(); }
  // The mapper has sent so many deltas: if the last ones do not come, they are asked for.
  void Expect(int64_t num_deltas) { follower_.Expect(num_deltas); }
  // What Take() gave did not fit the replica, for this reason: reported, counted, and a snapshot is asked for.
  void Reject(const std::string& sentence);
  bool needs_snapshot() const { return follower_.needs_snapshot(); }

 private:
  void Ask();

  StageContext& context_;
  std::function<void()> on_deltas_;
  MapFollower follower_;
  Publisher<MapRequest> requests_;
  std::optional<MapRequest> asked_;
  int64_t num_rejected_ = 0;
};

}  // namespace tessera
