// Bundle adjustment of all that hangs together with a closed loop, or of everything at the end of a run.
#pragma once

#include "map/map.h"
#include "messages/loop_types.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

// Optimizes the part of the map that holds keyframe `asked`: all its keyframes but the root of its spanning tree, and
// all landmarks that two of them see. The result answers `asked` and the map's last delta; it is not usable where the
// solver found nothing better. Throws std::invalid_argument if there is no such keyframe.
GlobalAdjustment AdjustGlobally(const Map& map, KeyframeId asked, const BundleOptions& options);

// The same with every part of the map, one after the other; answers Map::answered(). Parts for which the solver found
// nothing better are left out; if all are, the result is not usable.
GlobalAdjustment AdjustEveryPart(const Map& map, const BundleOptions& options);

}  // namespace tessera
