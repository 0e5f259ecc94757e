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
  double min_rival_z = 8.0;         // how many standard deviations worse each clearly different motion must be, see
                                    // EstimateTwoView; 0: a rival is no matter
  double max_direction_sigma_rad = 0.02;  // of the translation: worse, and turning can't be told from moving aside
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
// parallax to all.) It is clear if at least min_points have a small error and enough parallax, the direction of
// translation is well known, and each clearly different motion is worse beyond doubt: with d the difference of both
// errors of a pair,
//   z = sum d / sqrt(sum d^2) >= min_rival_z          (Vuong 1989, for models that are both approximations).
// nullopt if fewer than min_points pairs moved, or there is no motion. `seed` decides the samples.
std::optional<TwoViewResult> EstimateTwoView(const CameraCalibration& calibration, std::span<const PixelPair> pairs,
                                             uint64_t seed, const TwoViewOptions& options,
                                             std::span<const Rigid3> guesses = {});

}  // namespace tessera
