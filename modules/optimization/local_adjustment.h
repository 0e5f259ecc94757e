// Bundle adjustment of the keyframes and landmarks around a keyframe, inside the map.
#pragma once

#include <map>

#include "map/local_window.h"
#include "map/map_editor.h"
#include "messages/tracking_types.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

struct KeyframeMotion {
  KeyframeId reference;
  MotionPrior expected;
};
using KeyframeMotions = std::map<KeyframeId, KeyframeMotion>;

// The optimization problem of a window: inner poses free, outer ones fixed; a root of the spanning tree is fixed too.
// If nothing else fixes a pose, the oldest inner one is; mono then keeps the distance of the next one (scale).
//
// The double window: outer poses are free but for the oldest and observe nothing. Relative pose constraints hold them
// to up to kMaxConstraints keyframes of the window that share most landmarks with them, as firmly as the n shared
// landmarks at their depth z would:
//
//   information = n (f / sigma_px)^2 diag(1 / z^2, 1)                 of (translation, rotation)
//
// `motions`: where the camera of a keyframe should be by how it moved before, relative to another keyframe. Such priors
// take part where both are in the window; they are too weak to move what images fix.
BundleProblem BuildLocalProblem(const Map& map, const LocalWindow& window, const LocalWindowOptions& options,
                                const KeyframeMotions& motions = {});
inline constexpr int kMaxConstraints = 6;  // of an outer pose

// Writes poses and positions back, and removes the observations that the optimization found to be outliers, and
// landmarks that keep fewer than two. Landmarks that a moved keyframe alone sees move along with it.
void WriteBack(const BundleProblem& problem, const BundleResult& result, MapEditor& editor);

// Selects the window around `center`, optimizes it and writes the result back. Does nothing where there is nothing to
// optimize. Two rays meet somewhere whatever they show, also where keypoints only look alike: landmarks that fewer than
// `num_confirming` keyframes see, and none with depth, follow the poses and don't move them, unless there are too few
// others. A result that takes half of its observations from a keyframe has lost it, and is not taken.
void AdjustLocally(KeyframeId center, const LocalWindowOptions& window_options, const BundleOptions& bundle_options,
                   const KeyframeMotions& motions, MapEditor& editor);

}  // namespace tessera
