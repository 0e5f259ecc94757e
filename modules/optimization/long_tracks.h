// Landmarks that very many keyframes see.
#pragma once

#include "optimization/bundle_adjustment.h"

namespace tessera {

// Gives no point more than `max_observers` observations: the observers of one that has more are taken apart by their
// distance from it, into groups of equal size, and each group gets a point of its own, at the same place. The nearest
// keep the point itself; new ones are appended to `problem.points`, with its id. Observations stay in their order.
//
// Each pair of observers of a landmark is a block of the reduced camera system. On a straight road of 760 m, driven
// twice, a keyframe shares points with 839 of 2036 others; then the factorization fills up, and one global adjustment
// takes hours instead of seconds. Keyframes at the same distance are those of the same stretch, also of later visits:
// what ties laps together stays. What is lost is that far and near views show the same point.
void SplitLongTracks(int max_observers, BundleProblem& problem);

}  // namespace tessera
