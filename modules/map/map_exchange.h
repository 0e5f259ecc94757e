// What the owner of the map and its followers exchange besides deltas: a follower that lacks something asks
// (MAP_REQUEST), and gets deltas once more or the whole map page by page (MAP_SNAPSHOT).
#pragma once

#include <cstdint>

#include "map/map.h"

namespace tessera {

// A follower lacks something. Asking twice does no harm.
struct MapRequest {
  int64_t next_delta = -1;  // it has all deltas below this number; -1: it has none that it could build on
  int64_t snapshot = -1;    // pages of the snapshot with this number are asked for; -1: whatever leads on
  int32_t page = 0;         // the first of them

  // Sent for one request; who lacks more asks again. A page at a time, a large map would come at the pace of questions
  // and answers; more of them at once than a receive buffer holds would be lost.
  static constexpr int64_t kMaxDeltas = 16;
  static constexpr int32_t kMaxPages = 8;

  bool operator==(const MapRequest&) const = default;
};

// One page of a snapshot. `part` holds its share of the lists; its number, answers and hash are the whole snapshot's.
struct MapSnapshotPage {
  int32_t page = 0;
  int32_t num_pages = 1;
  MapDelta part;
};

// Pages of a snapshot, each small enough not to flood a receive buffer.
int32_t NumSnapshotPages(const MapDelta& snapshot);
// Page 0 .. NumSnapshotPages() - 1.
MapSnapshotPage CutSnapshotPage(const MapDelta& snapshot, int32_t page);

// Adds the next page to those before it.
void AppendPage(const MapSnapshotPage& page, MapDelta* snapshot);

}  // namespace tessera
