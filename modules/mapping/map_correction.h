// Loop corrections and global adjustments applied to the map: every keyframe moves, each by a transform of its own.
#pragma once

#include <map>

#include "core/id_map.h"
#include "map/map_editor.h"
#include "mapping/landmark_fusion.h"
#include "messages/loop_types.h"
#include "messages/tracking_types.h"

namespace tessera {

struct LoopFusionOptions {
  int num_neighbors = 15;                  // of either keyframe: their landmarks are fused too
  FusionOptions search{.radius_px = 4.0};  // for the older place's landmarks in the newer keyframes
};

// By keyframe: new_world_from_old_world.
using Corrections = std::map<KeyframeId, Sim3>;

// Moves keyframes and the landmarks that they observe:
//
//   world_from_keyframe <- C world_from_keyframe,   position <- C position
//
// A keyframe without a correction takes its parent's; if no ancestor has one, it stays. A landmark moves with the
// oldest keyframe that observes it: its normal is rotated and its range of distances scaled, so that matching finds it
// as before. Corrections of keyframes that are no longer in the map are ignored.
void ApplyCorrections(const Corrections& corrections, MapEditor& editor);

// Applies the loop's corrections and fuses the landmarks that both visits created: the loop's keyframe and its
// neighbors observe the older landmarks, and two parts of the map that the loop joins get one spanning tree. Both
// keyframes must be in the map.
void CloseLoop(const LoopResult& loop, const LoopFusionOptions& options, MapEditor& editor);

// What mends the scale of the part of the map that `keyframe` belongs to: `mendings` by keyframe. What came before the
// first of them stays. In the order of ids, which is that of the camera's way,
//
//   new_world_from_k = new_world_from_(k-1) [(k-1)_from_k, its translation times the factor at k-1]
//
// and keyframe k with what it sees is scaled by the factor at k.
Corrections ScaleCorrections(const Map& map, KeyframeId keyframe, const std::vector<ScaleMending>& mendings);

// The map's poses and positions at the moment when a global adjustment was requested.
struct AdjustmentBase {
  IdMap<KeyframeId, Rigid3> world_from_camera;
  IdMap<LandmarkId, Eigen::Vector3d> positions_in_world;
};
AdjustmentBase TakeBase(const Map& map);

// Applies to the present map what the adjustment changed relative to its base:
//
//   C = adjusted_world_from_camera camera_from_base_world
//
// Landmarks that have not moved since get their adjusted positions; the others move with their oldest keyframe.
void ApplyAdjustment(const GlobalAdjustment& adjustment, const AdjustmentBase& base, MapEditor& editor);

}  // namespace tessera
