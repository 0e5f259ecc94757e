// How fast a camera moves over the ground, in heights of the camera above it: what a single camera can't know, the
// scale of the world, the ground tells as long as that height stays what it was.
//
// Where the ground is a plane, a keypoint with the ray r sees it at  p = r / (down . r)  [heights]. Before a step of s
// heights along d, it was at  q(s) = R p + s d  in the camera's frame of then; R and d are known from the images. A
// keypoint that looks alike and lies where q(s) projects to speaks for s, the more the rarer such ones are:
//
//   w(s) = sum over keypoints that look alike of  N(projection of q(s) - keypoint; sigma) / (density of keypoints there
//          * share of all others that look as much alike)
//   log likelihood(s) = sum over keypoints on the ground of  log(1 + odds * min(w(s), about kMaxRatio))
//
// What chance would make of each descriptor counts as in EpipolarSearch (matching/epipolar_search.h). No keypoint needs
// to be a known point: a road of so little texture that nothing on it is followed for long is enough.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "geometry/rigid3.h"
#include "measurement/frame_view.h"

namespace tessera {

// By the logarithm of the speed: 0.1 to 100 heights/s in steps of 3 %.
inline constexpr double kMinGroundSpeed = 0.1;
inline constexpr double kGroundSpeedStep = 0.03;
inline constexpr int kNumGroundSpeeds = 230;
using GroundSpeeds = std::array<double, kNumGroundSpeeds>;

// The log-likelihood of the speeds between two frames `interval_s` > 0 apart, up to a constant. `last_from_current`:
// the rotation and, of any length but 0, the way. `down`: the direction towards the ground, at right angles to it, in
// the current camera, of length 1. nullopt: hardly anything on the ground is seen in both.
std::optional<GroundSpeeds> SpeedOverGround(const FrameView& last, const FrameView& current,
                                            const Rigid3& last_from_current, const Eigen::Vector3d& down,
                                            double interval_s);

}  // namespace tessera
