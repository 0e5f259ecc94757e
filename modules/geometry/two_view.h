// The first step of mono: camera motion and points from two images alone.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/camera.h"
#include "geometry/epipolar.h"
#include "geometry/keypoint_noise.h"
#include "geometry/rigid3.h"

namespace tessera {

struct PixelPair {
  Eigen::Vector2d first_px;
  Eigen::Vector2d second_px;
};

struct TwoViewOptions {
  double sigma_px = kMixedLevelSigmaPx;  // standard deviation of a keypoint coordinate
  int ransac_iterations = 300;           // samples for each model: 8 good of 8 are met with 99 % at 60 % good matches
  int min_points = 60;                   // points with good parallax and small error that a start needs
  double min_parallax_rad = 0.017;  // 1 degree: a point's depth is then good to about sigma_px / (f * 0.017) ~ 10 %
  double max_rival_share = 0.75;    // a different motion that explains more than this share of what the best explains
                                    // makes the case ambiguous
  double max_direction_sigma_rad = 0.03;  // of the translation: worse, and turning can't be told from moving aside
  std::optional<DirectionPrior> prior;    // takes part in the motion, and in how well its direction is known

  Result<> Check() const;
};

struct TwoViewResult {
  Rigid3 second_from_first;                            // |translation| = 1
  std::vector<std::optional<Eigen::Vector3d>> points;  // by pair, in the first camera; nullopt: not a good point
  int num_points = 0;
  bool is_clear = false;  // see EstimateTwoView
};

// Samples essential matrices (any scene) and homographies (a plane, where an essential matrix is not fixed by its
// points), takes every motion that the best of each kind allows, and `guesses`; refines each on all its inliers, and
// keeps the one that explains the pairs best: least sum of truncated squared errors from what points in front of both
// cameras, or at infinity, can show. (Not the one with most points of good parallax: a wrong motion sideways gives
// parallax to all.) It is clear if at least min_points have a small error and enough parallax, no clearly different
// motion explains nearly as much, and the direction of translation is well known. nullopt if there are fewer than
// min_points pairs, or no motion. `seed` decides the samples.
std::optional<TwoViewResult> EstimateTwoView(const CameraCalibration& calibration, std::span<const PixelPair> pairs,
                                             uint64_t seed, const TwoViewOptions& options,
                                             std::span<const Rigid3> guesses = {});

}  // namespace tessera
