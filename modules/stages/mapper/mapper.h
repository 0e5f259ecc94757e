// The mapper's step: one keyframe in, one change of the map out. No bus, no clock.
#pragma once

#include <string>

#include "map/local_window.h"
#include "map/map.h"
#include "map/removed_keyframes.h"
#include "map/tracking_types.h"
#include "optimization/bundle_adjustment.h"
#include "stages/mapper/culling.h"
#include "stages/mapper/landmark_creation.h"
#include "stages/mapper/landmark_fusion.h"

namespace tessera {

class MapEditor;

struct MapperOptions {
  CreationOptions creation;
  FusionOptions fusion;
  LocalWindowOptions window;
  BundleOptions bundle{.max_num_iterations = 5};  // a warm start; what is left comes with the next keyframe
  CullingOptions culling;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

class Mapper {
 public:
  // Throws std::invalid_argument with Check()'s sentence.
  explicit Mapper(const MapperOptions& options);

  // Takes the keyframe into the map and improves the map around it. The delta is a pure function of the keyframes given
  // so far. Throws std::invalid_argument if the id is not new or the lists do not fit the keypoints.
  MapDelta Process(const KeyframeObservation& seen);

  const Map& map() const { return map_; }
  // Where the culled keyframes stood.
  const RemovedKeyframes& removed_keyframes() const { return removed_; }

 private:
  void Insert(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveLandmarks(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveShared(const KeyframeObservation& seen, MapEditor& editor);
  // Returns those that a pair of keyframes made.
  std::vector<LandmarkId> CreateLandmarks(KeyframeId id, MapEditor& editor);

  const MapperOptions options_;
  Map map_;
  LandmarkTrial trial_;
  RemovedKeyframes removed_;
};

}  // namespace tessera
