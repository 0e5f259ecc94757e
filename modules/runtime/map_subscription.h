// A stage's subscription to the map: MAP_DELTA and MAP_SNAPSHOT in, MAP_REQUEST out when something is missing. How a
// follower catches up stands in map/map_follower.h.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "core/result.h"
#include "map/map_follower.h"
#include "messages/end_of_stream.h"
#include "runtime/stage.h"

namespace tessera {

class MapSubscription {
 public:
  // Applies the next delta, or a snapshot in place of those before it. If it does not fit, a snapshot is asked for.
  using Apply = std::function<Result<>(const MapFollower::Delta&)>;

  // `joins_late`: the map may be there already. `on_news`: called after deltas were applied, and at the mapper's end.
  MapSubscription(StageContext& context, bool joins_late, Apply apply, std::function<void()> on_news);
  MapSubscription(const MapSubscription&) = delete;
  MapSubscription& operator=(const MapSubscription&) = delete;

  // The first pose waits for this stage: the file of the map that the mapper begins with is read at once, instead of
  // when the mapper has loaded it, too.
  void ReadAhead();
  // The mapper's end is of interest: the last deltas are asked for if they do not come.
  void FollowToEnd();
  // The same for a stage that listens to END_OF_STREAM itself. Ends of other stages change nothing.
  void Receive(const EndOfStream& end);
  // The mapper has ended, and all its deltas were applied.
  bool is_complete() const {
    return mapper_end_ && !follower_.needs_snapshot() && follower_.next_delta() >= mapper_end_->num_values;
  }

  // A delta that Apply took did not fit after all, for this reason: it is reported, and a snapshot is asked for.
  void Reject(const std::string& reason);
  bool needs_snapshot() const { return follower_.needs_snapshot(); }

 private:
  std::optional<MapDelta> ReadLoadedMap() const;
  void TakeRestFromFile();
  void ApplyAll();
  void Ask();

  StageContext& context_;
  Apply apply_;
  std::function<void()> on_news_;
  MapFollower follower_;
  std::optional<MapDelta> read_ahead_;
  Publisher<MapRequest> requests_;
  std::optional<EndOfStream> mapper_end_;
  int64_t num_rejected_ = 0;
};

}  // namespace tessera
