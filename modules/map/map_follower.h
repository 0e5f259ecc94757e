// A follower's end of the map's deltas: puts them in order, each once, notices what is missing, says what to ask the
// owner for, and puts snapshots together. It holds no map: a replica applies what Take() gives, at once or later, and
// says so if it did not fit.
//
// Which frame sees which delta is decided elsewhere (tracking/tracker_time.h); this is about delivery alone.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "map/map_exchange.h"

namespace tessera {

class MapFollower {
 public:
  using Delta = std::shared_ptr<const MapDelta>;

  // `joins_late`: there may be a map already, which is asked for at once; otherwise the first delta is waited for.
  explicit MapFollower(bool joins_late = false) : lacks_start_(joins_late) {}

  // What came, in any order and any number of times.
  void Receive(Delta delta);
  void Receive(const MapSnapshotPage& page);
  // The first page of a snapshot has come, and no other: who has the whole of it elsewhere need not wait for the rest.
  const MapDelta* BegunSnapshot() const;
  // That whole: its number and hash are those of BegunSnapshot().
  void ReceiveRest(MapDelta whole);
  // The owner says that it has sent so many deltas.
  void Expect(int64_t num_deltas) { num_known_ = num_deltas; }
  // Takes out what can be applied next, in order; a snapshot may stand first.
  std::vector<Delta> Take();
  // What Take() gave did not fit the replica: it needs a snapshot now, and nothing is given out before that.
  void Reject() { needs_snapshot_ = true; }

  // What to ask the owner for; nullopt: nothing is known to be missing.
  std::optional<MapRequest> Request() const;
  // The same if it is to be sent now; nullopt also while the answer to an earlier one may be on its way.
  std::optional<MapRequest> TakeRequest();
  // No answer has come for long: what is missing is asked for again.
  void ForgetRequest() { asked_.reset(); }
  // Whether the replica waits for a snapshot after Reject().
  bool needs_snapshot() const { return needs_snapshot_; }
  // Number of the delta that Take() will give next.
  int64_t next_delta() const { return next_delta_; }

 private:
  struct Collected {
    int32_t num_pages = 0;
    int32_t next_page = 0;
    MapDelta whole;
  };
  void Complete();
  bool IsAnsweredSoon(const MapRequest& request) const;

  // Deltas kept behind a gap, the first ones; more are dropped, and asked for when the gap is closed.
  static constexpr size_t kMaxWaiting = 256;

  bool lacks_start_;
  bool needs_snapshot_ = false;
  int64_t next_delta_ = 0;
  int64_t num_known_ = 0;             // at least so many exist
  std::map<int64_t, Delta> waiting_;  // by number
  std::optional<Collected> collected_;
  std::optional<MapRequest> asked_;
  Delta snapshot_;  // complete, and not yet taken
};

}  // namespace tessera
