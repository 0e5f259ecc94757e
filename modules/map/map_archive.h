// The owner's answers to followers that lack something: its last deltas once more, or a snapshot page by page.
//
// Snapshots are older than the map, and the deltas since are kept: a follower that was killed and restarted may have to
// repeat its steps on the map as it was then.
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
    std::vector<MapSnapshotPage> pages;                   // in order
  };

  // The owner began with this map.
  void Begin(const Map& map);
  // A delta was sent; `map` is the owner's after it. `awaited`: number of a delta that somebody is still to answer, and
  // must find again when started anew; nullopt: none.
  void Add(std::shared_ptr<const MapDelta> delta, const Map& map, std::optional<int64_t> awaited);
  // What to send to one who asks; `map` is the owner's, after the last delta added. Nothing if the asker lacks nothing,
  // or if there is no map yet.
  Answer AnswerTo(const MapRequest& request, const Map& map);

  // A snapshot is taken of the first delta, and then this often, in deltas. The one handed out is of the beginning, or
  // between one and two such intervals old, or else the last before the awaited delta.
  static constexpr int64_t kSnapshotInterval = 48;

 private:
  std::deque<std::shared_ptr<const MapDelta>> deltas_;  // all since the oldest snapshot, or all
  std::deque<MapDelta> snapshots_;                      // by age; features are shared with the map
};

}  // namespace tessera
