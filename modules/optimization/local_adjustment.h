// Bundle adjustment of the keyframes and landmarks around a keyframe, inside the map.
#pragma once

#include "map/local_window.h"
#include "map/map_editor.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

// The optimisation problem of a window: inner poses free, outer ones fixed; a root of the spanning tree is fixed too.
// If nothing else fixes a pose, the oldest inner one is; mono then keeps the distance of the next one (scale).
//
// The double window: outer poses are free but for the oldest, observe nothing, and are tied to up to kMaxTies of the
// keyframes of the window that share most landmarks with them. A tie keeps the relative pose as it is, as firmly as the
// n shared landmarks at their depth z would:
//
//   information = n (f / sigma_px)^2 diag(1 / z^2, 1)                 of (translation, rotation)
BundleProblem BuildLocalProblem(const Map& map, const LocalWindow& window, const LocalWindowOptions& options);
inline constexpr int kMaxTies = 6;

// Writes poses and positions back, and removes the observations that the optimisation found to be outliers, and
// landmarks that keep fewer than two. Landmarks that a moved keyframe alone sees move along with it.
void WriteBack(const BundleProblem& problem, const BundleResult& result, MapEditor& editor);

// Selects the window around `center`, optimises it and writes the result back. Does nothing where there is nothing to
// optimise.
void AdjustLocally(KeyframeId center, const LocalWindowOptions& window_options, const BundleOptions& bundle_options,
                   MapEditor& editor);

}  // namespace tessera
