// The mapper's step: one keyframe in, one change of the map out. No bus, no clock.
#pragma once

#include <optional>
#include <string>

#include "core/result.h"
#include "map/local_window.h"
#include "map/map.h"
#include "map/removed_keyframes.h"
#include "mapping/correction_schedule.h"
#include "mapping/keyframe_culling.h"
#include "mapping/landmark_creation.h"
#include "mapping/landmark_culling.h"
#include "mapping/landmark_fusion.h"
#include "mapping/lens_refiner.h"
#include "mapping/map_correction.h"
#include "messages/mapper_step.h"
#include "messages/tracking_types.h"
#include "optimization/bundle_adjustment.h"
#include "optimization/local_adjustment.h"

namespace tessera {

class MapEditor;

struct MapperOptions {
  CreationOptions creation;
  FusionOptions fusion;
  LocalWindowOptions window;
  BundleOptions bundle{.max_num_iterations = 5};  // a warm start; the next keyframe continues
  // Around a new keyframe with depth, which brings the scale along, fewer steps and fewer poses that hold the window
  // do as well.
  int max_iterations_with_depth = 2, max_outer_keyframes_with_depth = 15;
  LandmarkCullingOptions landmark_culling;
  KeyframeCullingOptions keyframe_culling;
  LoopFusionOptions loop_fusion;
  // How many keyframes are mapped with caution after one whose way the images leave open (Mapper).
  int num_cautious_keyframes = 25;
  // Mono: focal lengths and distortion are those that explain the map best, where the calibration's clearly don't.
  bool refines_focal = true;
  bool polishes = false;  // Finish() asks for a last global adjustment, of every part of the map, also without loops

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Where the images leave the way of the camera open, points that only look alike decide it. A keyframe that brings an
// expected motion says so; from there on, for a while,
// - no keypoint is paired with a keyframe in which a far point of its ray would lie beside the image,
// - new landmarks stay only if keyframes other than the pair that made them confirm them,
// - landmarks of few observers don't move poses.
// Elsewhere these rules would cost more true landmarks than false ones, half of all in a street.
class Mapper {
 public:
  // Throws std::invalid_argument with Check()'s sentence.
  explicit Mapper(const MapperOptions& options);

  // Starts with an existing map. To be called first, if at all. Fails as Map::Apply does.
  Result<> Load(const MapDelta& snapshot) { return map_.Apply(snapshot); }

  // Applies the corrections that are due, inserts the keyframe and improves the map around it. The delta is a pure
  // function of all input so far; it asks for a global adjustment after a loop was closed, unless one is under way.
  // Throws std::invalid_argument if the id is not new or the lists do not fit the keypoints.
  MapDelta Process(const KeyframeObservation& seen, const DueCorrections& due = {});
  // What Repeat needs of the last step of Process, which returned `delta`.
  MapperStep LastStep(const MapDelta& delta) const;
  // Takes a step that Process took in an earlier life, on the same input: without its work, and is the same mapper from
  // then on. `step`, which must be repeatable, is what LastStep said then. Fails, and can't go on, if it does not fit.
  Result<> Repeat(const KeyframeObservation& seen, const MapperStep& step);
  // Applies the corrections that are due when no further keyframe will come, culls the newest keyframes where they are
  // redundant, and asks for a last global adjustment after loops, or anyway to polish the map. nullopt if nothing
  // changes: then the map is final.
  std::optional<MapDelta> Finish(const DueCorrections& due);

  const Map& map() const { return map_; }
  // Loops that were ignored since the map was corrected after they were found: the next keyframes find them again.
  int64_t num_void_loops() const { return num_void_loops_; }
  // How often the scale was mended, as the ground shows it (KeyframeObservation::mendings).
  int64_t num_scale_mendings() const { return num_scale_mendings_; }
  const LensRefiner& lens_refiner() const { return lens_refiner_; }
  // The poses of culled keyframes.
  const RemovedKeyframes& removed_keyframes() const { return removed_; }

 private:
  bool CullLast(KeyframeId last, MapEditor& editor);
  bool ApplyDue(const DueCorrections& due, KeyframeId now, MapEditor& editor);
  bool ApplyDueLoops(const std::vector<LoopResult>& loops, KeyframeId now, MapEditor& editor);
  bool ApplyDueAdjustment(const GlobalAdjustment& adjustment, KeyframeId now, MapEditor& editor);
  bool RefineLens(const KeyframeObservation& seen, MapEditor& editor);
  bool MendScale(const KeyframeObservation& seen, MapEditor& editor);
  void RemoveNotScene(const KeyframeObservation& seen, MapEditor& editor);
  void NoteCorrected(KeyframeId now);
  bool AskForAdjustment(KeyframeId now);
  void Insert(const KeyframeObservation& seen, MapEditor& editor);
  void RememberMotion(const KeyframeObservation& seen);
  bool IsCautious(KeyframeId now) const { return cautious_until_.valid() && now <= cautious_until_; }
  LocalWindowOptions Window(KeyframeId now) const;
  void AdjustAround(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveLandmarks(const KeyframeObservation& seen, MapEditor& editor);
  void ObserveShared(const KeyframeObservation& seen, MapEditor& editor);
  // Returns those created from pairs of keyframes.
  std::vector<LandmarkId> CreateLandmarks(KeyframeId id, MapEditor& editor);

  const MapperOptions options_;
  Map map_;
  KeyframeMotions motions_;    // of keyframes in the map
  KeyframeId cautious_until_;  // the last keyframe to be mapped with caution, if no other asks for it
  RecentLandmarks recent_landmarks_;
  RemovedKeyframes removed_;
  KeyframeCuller keyframe_culler_;
  LensRefiner lens_refiner_;
  bool is_repeatable_ = false;          // the last step: no corrections, which have states of their own
  LandmarkId first_recent_;             // of the last step
  KeyframeId last_corrected_;           // the delta that answers it corrected the map
  bool wants_adjustment_ = false;       // a loop was closed after the last adjustment was requested
  std::optional<AdjustmentBase> base_;  // of the adjustment under way
  KeyframeId last_asked_;               // the last delta that requested an adjustment answers it
  bool is_base_outdated_ = false;       // a loop was closed since: the adjustment is ignored
  bool is_culled_ = false;              // by Finish()
  bool is_polish_asked_ = false;
  int64_t num_void_loops_ = 0;
  int64_t num_scale_mendings_ = 0;
};

}  // namespace tessera
