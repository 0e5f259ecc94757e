// What the mapper does with everything that reaches it: keyframes, loops, global adjustments, requests for the map and
// the end of the stream in, actions out. No bus, no clock.
//
// Keyframes are processed in order, each when the corrections are there that must be applied before it
// (correction_schedule.h):
//
//   kAwaitsKeyframe     no keyframe waits
//   kAwaitsCorrections  the first keyframe that waits, or the end, needs a loop result or an adjustment that is missing
//   kReady              Advance() will process the first keyframe
//   kEnding             the last keyframe is in the map: Advance() will apply what is left, or end
//   kFinished           the map is final
//   kFailed             a keyframe is missing
//
// Inputs and Advance() are the only transitions; kFinished and kFailed are final.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "core/result.h"
#include "core/session_actions.h"
#include "map/map_archive.h"
#include "map/removed_keyframes.h"
#include "mapping/correction_schedule.h"
#include "mapping/mapper.h"
#include "messages/end_of_stream.h"

namespace tessera {

struct MapperSessionOptions {
  MapperOptions mapper;
  CorrectionDelays delays;
  bool closes_loops = true;  // false: no keyframe waits for loop results

  Result<> Check() const;
};

// Values are to be published, but for a MapperStep: that is for the journal.
using MapperAction = std::variant<std::shared_ptr<const MapDelta>, RemovedInDelta, MapSnapshotPage, EndOfStream,
                                  MapperStep, Fail, Finish>;
using MapperActions = std::vector<MapperAction>;

class MapperSession {
 public:
  enum class State { kAwaitsKeyframe, kAwaitsCorrections, kReady, kEnding, kFinished, kFailed };

  // Throws std::invalid_argument with Check()'s sentence.
  explicit MapperSession(const MapperSessionOptions& options);

  // Begins with a map that was made before. To be called first, if at all.
  Result<MapperActions> Load(const MapDelta& snapshot);

  // Keyframes must come without gaps: each delta answers one, and the tracker waits for it.
  MapperActions Receive(KeyframeObservation keyframe);
  MapperActions Receive(const LoopResult& result);
  MapperActions Receive(const GlobalAdjustment& adjustment);
  // A follower of the map lacks something: it is answered at once.
  MapperActions Receive(const MapRequest& request);
  // The tracker has sent `tracker_end.num_values` keyframes.
  MapperActions Receive(const EndOfStream& tracker_end);

  // Takes one step if the state is kReady or kEnding, else does nothing. `taken`: what an earlier life said of this
  // step; nullopt: nothing is known of it.
  MapperActions Advance(const std::optional<MapperStep>& taken = std::nullopt);

  State state() const;
  size_t num_waiting() const { return waiting_.size(); }  // keyframes
  const Map& map() const { return mapper_.map(); }
  const LensRefiner& lens_refiner() const { return mapper_.lens_refiner(); }
  int64_t num_scale_mendings() const { return mapper_.num_scale_mendings(); }

 private:
  // The last keyframe that gets a loop result; invalid: there are none.
  KeyframeId last_loop() const { return options_.closes_loops ? KeyframeId{next_keyframe_.value - 1} : KeyframeId{}; }
  // Whether the map may still change when the last keyframe is in it.
  bool may_change() const { return num_processed_ > 0; }
  MapperActions Process(const std::optional<MapperStep>& taken);
  MapperActions End();
  MapperActions Publish(MapDelta delta);

  const MapperSessionOptions options_;
  Mapper mapper_;
  CorrectionSchedule schedule_;
  KeyframeId next_keyframe_{0};  // the next to come
  std::deque<KeyframeObservation> waiting_;
  int64_t num_processed_ = 0;  // keyframes
  MapArchive archive_;
  KeyframePoses places_;
  std::optional<EndOfStream> tracker_end_;
  bool has_finished_ = false;
  bool has_failed_ = false;
};

}  // namespace tessera
