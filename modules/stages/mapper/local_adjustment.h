// Bundle adjustment of the keyframes and landmarks around a keyframe, inside the map.
#pragma once

#include "map/local_window.h"
#include "map/map_editor.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

// The optimisation problem of a window: inner poses free, outer ones fixed; a root of the spanning tree is fixed too. If
// nothing else fixes a pose, the oldest inner one is; mono then keeps the distance of the next one (scale).
BundleProblem BuildLocalProblem(const Map& map, const LocalWindow& window);

// Writes poses and positions back, and removes the observations that the optimisation found to be outliers, and
// landmarks that keep fewer than two. Landmarks that a moved keyframe alone sees move along with it.
void WriteBack(const BundleProblem& problem, const BundleResult& result, MapEditor& editor);

// Selects the window around `center`, optimises it and writes the result back. Does nothing where there is nothing to
// optimise.
void AdjustLocally(KeyframeId center, const LocalWindowOptions& window_options, const BundleOptions& bundle_options,
                   MapEditor& editor);

}  // namespace tessera
