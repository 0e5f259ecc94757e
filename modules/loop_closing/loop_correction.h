// The correction of the map that a loop asks for: the pose of every keyframe, so that both visits of a place agree.
#pragma once

#include <optional>
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

// The essential graph of the part of the map that holds both keyframes: the spanning tree, pairs that share many
// landmarks, the loops closed before, and the new one. Edges measure the present relative poses, with the covariance of
// their link (link_covariance.h), but the new loop the verified one. The root is fixed. R. Mur-Artal, J. M. M. Montiel,
// J. D. Tardos, "ORB-SLAM", T-RO 2015.
//
// If the two belong to different parts, the graph holds both: that which began later starts as the loop places it, as a
// whole, and where one ends and the other continues, an edge says how the camera must have moved in between
// (gap_motion.h).
PoseGraphProblem BuildEssentialGraph(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                     const CorrectionOptions& options);

struct LoopCorrection {
  std::vector<LoopResult::Correction> keyframes;  // by id
  // By how many standard deviations the map contradicts the loop: sqrt(2 cost) of the optimized graph, as all edges but
  // the loop's measure the map as it was. Loops of a sound map have 1 to 9, where the scale had slipped 18 to 150.
  double contradiction_sigmas = 0.0;
};

// Corrects every keyframe of the essential graph. Without a link across a gap, the part that began later moves as a
// whole, and the other stays. nullopt: no solution.
std::optional<LoopCorrection> ComputeCorrection(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                                const CorrectionOptions& options);

}  // namespace tessera
