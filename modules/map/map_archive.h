// The owner's answers to followers that lack something: its last deltas once more, or a snapshot page by page.
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map/map_exchange.h"

namespace tessera {

class MapArchive {
 public:
  struct Answer {
    std::vector<std::shared_ptr<const MapDelta>> deltas;  // to be sent again, in order
    std::optional<MapSnapshotPage> page;
  };

  // A delta was sent.
  void Add(std::shared_ptr<const MapDelta> delta);
  // What to send to one who asks; `map` is the owner's, after the last delta added. Nothing if the asker lacks nothing,
  // or if there is no map yet.
  Answer AnswerTo(const MapRequest& request, const Map& map);

  // A follower that lacks no more than so many deltas gets these; one that lacks more, a snapshot.
  static constexpr size_t kMaxDeltas = 16;
  // Several followers may be in the middle of different ones. Features are shared with the map, so these cost little.
  static constexpr size_t kMaxSnapshots = 2;

 private:
  const MapDelta& NewSnapshot(const Map& map);

  std::deque<std::shared_ptr<const MapDelta>> deltas_;
  std::deque<MapDelta> snapshots_;  // the newest last
};

}  // namespace tessera
