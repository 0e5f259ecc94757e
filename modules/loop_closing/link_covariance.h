// How well a map knows where two of its keyframes stand to each other, and in which ratio their units are.
#pragma once

#include <Eigen/Core>
#include <map>
#include <span>
#include <vector>

#include "map/map.h"

namespace tessera {

using Matrix7 = Eigen::Matrix<double, 7, 7>;

// Two keyframes that share landmarks.
struct KeyframePair {
  KeyframeId older;
  KeyframeId newer;
};

// By keyframe: how far its landmarks are, in units of the map (MedianDepth).
using MedianDepths = std::map<KeyframeId, double>;
MedianDepths MedianDepthsOf(const Map& map, std::span<const KeyframeId> part);

// By link: the covariance of older_from_newer, of its error's tangent (PoseGraphEdge) in the newer camera's axes and
// units; never infinite. `part`: all keyframes of the part of the map that holds the links, by id; `depths`: theirs.
//
// 1. What common landmarks leave open. Cut at a link, the map is two bodies: one as the keyframes up to `older` know
// it, the other as those from `newer` on do. What both know of a common landmark holds the two together:
//
//   covariance = (H / kInflation + I_bound)^-1,   H = sum_k J_k' (A_k^-1 + B_k^-1)^-1 J_k,   J_k = [I, -[x_k]x, x_k]
//
// x_k: the landmark in the newer camera; A_k, B_k: the information that the observations on either side hold about its
// position, their poses taken as exact; I_bound: kLinkBounds. Far landmarks hold the rotation, and say little about
// the length of the step and nothing of the scale. One view of mono has no scale of its own that could have slipped:
// the links of the first and the last keyframe have covariance zero.
//
// 2. What landmarks don't see. After false matches the scale slips although all residuals are small; but then both the
// camera's speed and the depth of what it sees change by the same factor, at once. Of a camera that brakes only the
// speed does. With d(.) the change of the mean from one second before to one second after, what exceeds
// kPlausibleChange of the common part of d(ln speed) and d(ln median depth) counts as standard deviation of the log
// scale, spread over those two seconds.
std::vector<Matrix7> LinkCovariances(const Map& map, std::span<const KeyframeId> part,
                                     std::span<const KeyframePair> links, const MedianDepths& depths);

// Standard deviations that are never exceeded in 1.
struct LinkBounds {
  double depths = 1.0;  // of the translation, in median depths of the newer keyframe
  double rotation_rad = 0.1;
  double log_scale = 1.0;
};
inline constexpr LinkBounds kLinkBounds;
// Poses on either side are not exact, and their errors agree from link to link: over 25 keyframes the scale of three
// laps drifted by one to five of the standard deviations that H alone gives.
inline constexpr double kInflation = 10.0;
inline constexpr double kPlausibleChange = 0.15;  // of the logarithms, within a second
inline constexpr double kMaxChange = 2.3;         // a factor of ten

}  // namespace tessera
