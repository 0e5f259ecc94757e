// How the map must bend so that a place seen twice is one.
#pragma once

#include <string>
#include <vector>

#include "loop_closing/place_verification.h"
#include "map/map.h"
#include "messages/loop_types.h"
#include "optimization/pose_graph.h"

namespace tessera {

struct CorrectionOptions {
  int min_shared_landmarks = 100;  // keyframes that share as many are joined in the graph (Strasdat et al. 2011)
  double loop_weight = 1.0;        // of the new loop's edge, against one edge of the path
  PoseGraphOptions graph;

  // Empty if all is well, else one sentence.
  std::string Check() const;
};

// The keyframes of one part of the map in the essential graph: the spanning tree, pairs that share many landmarks, the
// loops closed before, and the new one. All keep their present relative poses but the new loop, which has the measured
// one. The root stays. R. Mur-Artal, J. M. M. Montiel, J. D. Tardos, "ORB-SLAM", T-RO 2015.
PoseGraphProblem BuildEssentialGraph(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                     const CorrectionOptions& options);

// Where both keyframes belong to one part of the map, the essential graph optimised; where they don't, the part that
// began later moves to the other as a whole. By id. Empty: no solution.
std::vector<LoopResult::Correction> CorrectMap(const Map& map, KeyframeId current, const VerifiedPlace& place,
                                               const CorrectionOptions& options);

}  // namespace tessera
