// How the camera moved from one frame to the next by all their keypoints, known points or not: what is left where steps
// are so wide that the map has hardly anything in view.
#pragma once

#include <optional>

#include "core/result.h"
#include "geometry/epipolar.h"
#include "geometry/two_view.h"
#include "matching/matching.h"
#include "matching/point_matching.h"

namespace tessera {

struct PairMotionOptions {
  MatchingOptions matching;  // anywhere in the image
  TwoViewOptions two_view{.ransac_iterations = 3000,
                          .min_points = 50,
                          .min_parallax_rad = 0.005,
                          .min_rival_z = 0.0,
                          .max_direction_sigma_rad = 0.03};
  int min_known_points = 8;        // of known depth, which tells the length of the step
  double max_depth_spread = 0.25;  // half of them must agree on it within this share
  double min_cos_expected = 0.8;   // without them: between the step and the expected one
  // Where the motion so far helps to tell turning from moving aside: how well the direction must be known then, and how
  // well it is at best.
  double max_direction_sigma_rad = 0.15;
  double min_expected_sigma_rad = 0.1;

  Result<> Check() const;
};

// last_from_current, in world units: rotation and direction from the essential matrix (EstimateTwoView), the length as
// the known points that `last` sees have it, and the depths that it measured itself: the median over them of their
// depth by the depth of unit length. Where they are too few or disagree, the length of `expected`, the way by the
// motion so far, if the direction is about that one's. nullopt if there is neither, or the motion is not determined.
// The two views need not do that by themselves: walls at either side of a corner leave open how much of a step is a
// turn, by more than `expected` does.
//
// A rival motion doesn't refuse it, as it does at the start: the known points or the motion so far confirm the best
// one.
std::optional<Rigid3> EstimatePairMotion(const TrackedFrame& last, const FrameView& current,
                                         const std::optional<DirectionPrior>& expected,
                                         const PairMotionOptions& options);

}  // namespace tessera
