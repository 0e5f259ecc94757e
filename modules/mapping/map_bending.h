// What loops and global bundle adjustments change: the whole map moves, each keyframe by a transform of its own.
#pragma once

#include <map>
#include <optional>

#include "map/map_editor.h"
#include "mapping/landmark_fusion.h"
#include "messages/loop_types.h"

namespace tessera {

struct LoopFusionOptions {
  int num_neighbours = 15;                 // of either keyframe, which share in the loop
  FusionOptions search{.radius_px = 4.0};  // for the older place's landmarks in the newer keyframes
};

// By keyframe: new_world_from_old_world.
using Corrections = std::map<KeyframeId, Sim3>;

// Moves every keyframe and what it sees:
//
//   world_from_keyframe <- C world_from_keyframe,   position <- C position
//
// A keyframe without a correction takes its parent's; if no ancestor has one, it stays. A landmark moves with the
// oldest keyframe that sees it: its normal turns, and its distances grow, so that it is looked for as before.
void BendMap(const Corrections& corrections, MapEditor& editor);

// Bends the map as the loop asks, and makes the two places one: the loop's keyframe sees the older place's landmarks,
// and so do those around it; parts that it joins get one spanning tree. Both keyframes must be in the map.
void CloseLoop(const LoopResult& loop, const LoopFusionOptions& options, MapEditor& editor);

// The map's poses and positions at the moment when a global adjustment is asked for.
struct AdjustmentBase {
  std::map<KeyframeId, Rigid3> world_from_camera;
  std::map<LandmarkId, Eigen::Vector3d> positions_in_world;
};
AdjustmentBase TakeBase(const Map& map);

// The map as it is now, with what the adjustment changed against its base:
//
//   C = adjusted_world_from_camera camera_from_base_world
//
// Landmarks that have not moved since get their adjusted positions, others move along.
void ApplyAdjustment(const GlobalAdjustment& adjustment, const AdjustmentBase& base, MapEditor& editor);

}  // namespace tessera
