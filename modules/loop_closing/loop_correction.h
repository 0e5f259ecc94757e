// The correction of the map that a loop asks for: the pose of every keyframe, so that both visits of a place agree.
#pragma once

#include <vector>

#include "core/result.h"
#include "loop_closing/place_verification.h"
#include "map/map.h"
#include "messages/loop_types.h"
#include "optimization/pose_graph.h"

namespace tessera {

struct CorrectionOptions {
  int min_shared_landmarks = 100;  // keyframes that share as many are joined in the graph (Strasdat et al. 2011)
  double loop_weight = 1.0;        // of the new loop's edge, against one edge of the path
  PoseGraphOptions graph;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// The essential graph of one part of the map: the spanning tree, pairs that share many landmarks, the
// loops closed before, and the new one. Edges measure the present relative poses, but the new loop the verified one.
// The root is fixed. R. Mur-Artal, J. M. M. Montiel, J. D. Tardos, "ORB-SLAM", T-RO 2015.
PoseGraphProblem BuildEssentialGraph(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                     const CorrectionOptions& options);

// Corrections by keyframe id. If both keyframes belong to one part of the map, they follow from the optimized essential
// graph; if they don't, the part that began later moves to the other as a whole. Empty: no solution.
std::vector<LoopResult::Correction> ComputeCorrections(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                                       const CorrectionOptions& options);

}  // namespace tessera
