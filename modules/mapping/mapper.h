// The mapper's step: one keyframe in, one change of the map out. No bus, no clock.
#pragma once

#include <optional>
#include <string>

#include "map/local_window.h"
#include "map/map.h"
#include "map/removed_keyframes.h"
#include "mapping/correction_schedule.h"
#include "mapping/culling.h"
#include "mapping/landmark_creation.h"
#include "mapping/landmark_fusion.h"
#include "mapping/map_bending.h"
#include "messages/tracking_types.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

class MapEditor;

struct MapperOptions {
  CreationOptions creation;
  FusionOptions fusion;
  LocalWindowOptions window;
  BundleOptions bundle{.max_num_iterations = 5};  // a warm start; what is left comes with the next keyframe
  CullingOptions culling;
  LoopFusionOptions loop_fusion;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

class Mapper {
 public:
  // Throws std::invalid_argument with Check()'s sentence.
  explicit Mapper(const MapperOptions& options);

  // Begins with a map made before. To be called first, if at all. Returns Map::Apply's sentence.
  [[nodiscard]] std::string Load(const MapDelta& snapshot) { return map_.Apply(snapshot); }

  // Bends the map as is due, takes the keyframe in and improves the map around it. The delta is a pure function of what
  // was given so far; it asks for a global adjustment after a loop was closed, if none is on its way. Throws
  // std::invalid_argument if the id is not new or the lists do not fit the keypoints.
  MapDelta Process(const KeyframeObservation& seen, const DueCorrections& due = {});
  // Bends the map as is due when no further keyframe will come; after loops, a last adjustment of all is asked for.
  // nullopt if nothing changes: then there is nothing more to come.
  std::optional<MapDelta> Finish(const DueCorrections& due);

  const Map& map() const { return map_; }
  // Loops that were found on a map that was bent meanwhile: the next keyframes find them again.
  int64_t num_void_loops() const { return num_void_loops_; }
  // Where the culled keyframes stood.
  const RemovedKeyframes& removed_keyframes() const { return removed_; }

 private:
  bool Bend(const DueCorrections& due, KeyframeId now, MapEditor& editor);
  bool AskForAdjustment(KeyframeId now);
  void Insert(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveLandmarks(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveShared(const KeyframeObservation& seen, MapEditor& editor);
  // Returns those that a pair of keyframes made.
  std::vector<LandmarkId> CreateLandmarks(KeyframeId id, MapEditor& editor);

  const MapperOptions options_;
  Map map_;
  LandmarkTrial trial_;
  RemovedKeyframes removed_;
  KeyframeId last_bent_;                // the map was bent in the delta that answers it
  bool wants_adjustment_ = false;       // a loop was closed that no adjustment has taken in yet
  std::optional<AdjustmentBase> base_;  // of the one under way
  KeyframeId last_asked_;               // the last delta that asked for an adjustment answers it
  bool is_base_bent_ = false;           // a loop was closed since: it comes too late
  int64_t num_void_loops_ = 0;
};

}  // namespace tessera
