// The owner's answers to followers that lack something: its last deltas once more, or a snapshot page by page.
//
// Snapshots are older than the map, and the deltas since are kept: a follower that was killed and restarted may have to
// repeat its steps on the map as it was then. So the archive follows the owner's map with some delay, delta by delta,
// and lists the map as it was only for those who ask: a list of a large map at each interval would make the tracker
// wait.
#pragma once

#include <cstdint>
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
  void Begin(const Map& map) { old_map_ = map; }
  // A delta was sent. `awaited`: number of a delta that somebody is still to answer, and must find again when started
  // anew; nullopt: none.
  void Add(std::shared_ptr<const MapDelta> delta, std::optional<int64_t> awaited);
  // What to send to one who asks. Nothing if the asker lacks nothing, or if there is no map yet.
  Answer AnswerTo(const MapRequest& request);

  // The map that is handed out is the first that there was, or so many deltas old, up to twice as many; while a delta
  // is awaited, it is older than that one.
  static constexpr int64_t kDelay = 48;

 private:
  // Pages are asked for one after the other, all of the same snapshot.
  struct Snapshot {
    MapDelta whole;
    int64_t asked = 0;  // the newest delta when a page was last asked for
  };

  int64_t newest() const { return deltas_.empty() ? old_map_.next_delta() - 1 : deltas_.back()->number; }
  void FollowOwner(std::optional<int64_t> awaited);
  MapSnapshotPage FirstPage();

  Map old_map_;
  std::deque<std::shared_ptr<const MapDelta>> deltas_;  // all since the oldest map that is handed out
  std::deque<Snapshot> snapshots_;                      // by age; features are shared with the map
};

}  // namespace tessera
