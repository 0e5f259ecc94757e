// How a camera moved while nothing was tracked, by how it moved before and after.
#pragma once

#include <optional>

#include "geometry/rigid3.h"
#include "loop_closing/link_covariance.h"
#include "map/map.h"

namespace tessera {

struct GapMotion {
  Sim3 before_from_after;
  Matrix7 covariance = Matrix7::Zero();  // as in PoseGraphEdge, in the axes and units of the keyframe after the gap
};

// Between the last two keyframes before the gap and the first two after it; each two belong to one part of the map, in
// units of its own. The camera kept its speed, which gives the ratio of the units (mono), and turned at the mean of
// both rates, but for kSpeedChange and kTurnChange. nullopt: the gap or a step lasts longer than kMaxGap_s, or the
// camera stood still on one side of it.
std::optional<GapMotion> MotionAcrossGap(const Keyframe& earlier, const Keyframe& before, const Keyframe& after,
                                         const Keyframe& later);
inline constexpr double kMaxGap_s = 10.0;
inline constexpr double kSpeedChange = 0.3;  // of the speed, also of the way that it gives
inline constexpr double kTurnChange_rad_s = 0.2;

}  // namespace tessera
