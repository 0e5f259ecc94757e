// The similarity between two regions of a map, or two maps, that hold the same landmarks twice.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"

namespace tessera {

// One landmark as two maps, or two keyframes of one map that has drifted, know it.
struct PointPair {
  Eigen::Vector3d point_in_first = Eigen::Vector3d::Zero();   // in the camera frame of the first keyframe
  Eigen::Vector3d point_in_second = Eigen::Vector3d::Zero();  // in that of the second; mono: each in units of its map
  PixelObservation seen_first;                                // where the first keyframe saw it
  PixelObservation seen_second;
};

struct SimilarityOptions {
  bool has_scale = true;  // Sim(3), for mono; false: SE(3), the scale stays what it was (1) to the bit
  // As in Reprojection. 0 leaves right columns aside, as they must be where the scale is free (has_scale).
  double baseline_m = 0.0;
  int ransac_iterations = 300;  // three good of three are met with 99.9 % at 30 % good pairs
  int min_inliers = 20;         // fewer may agree by chance
  // Standard deviations of pixels are taken this many times as large, since the landmarks are not known exactly either:
  // the limit of 95 % becomes that of 99 %.
  double sigma_factor = 1.24;
  // Standard deviation of a landmark's depth as a fraction of it, where no right column measures it better. It is what
  // keeps far points of mono maps, and also tells the scale from the ratios of depths: seen from the same position, two
  // maps of any scale give the same pixels.
  double depth_sigma = 0.1;
  int num_rounds = 4;      // of refinement; after each, pairs are sorted anew into inliers and outliers
  int max_iterations = 6;  // Levenberg-Marquardt steps a round; they converge in 2 to 4 from a fair start
  // Points on a line, or all in one direction, leave a rotation open: no estimate where the rotation is known worse
  // than this.
  double max_rotation_sigma_rad = 0.03;

  Result<> Check() const;
};

struct SimilarityEstimate {
  Sim3 first_from_second;       // point_in_first = first_from_second * point_in_second
  std::vector<char> is_inlier;  // by pair: 1 if both reprojections are within the limit
  int num_inliers = 0;
  double rotation_sigma_rad = 0.0;  // of the worst axis; infinite if open
};

// Without an initial guess: RANSAC over triples (AlignPoints). A pair is an inlier if each keyframe sees the
// other's point within the chi-square limit (e' W e, see below) and the two depths agree to 3 sigmas (of d). Each new
// best is refined on its inliers (O. Chum, J. Matas, J. Kittler, "Locally Optimized RANSAC", DAGM 2003), since the
// depths of three points are noisy. `seed` decides the samples. nullopt: fewer than min_inliers agree, or they leave
// the rotation open (max_rotation_sigma_rad). Throws std::invalid_argument with Check()'s sentence.
std::optional<SimilarityEstimate> EstimateSimilarity(const CameraCalibration& calibration,
                                                     std::span<const PointPair> pairs, uint64_t seed,
                                                     const SimilarityOptions& options);

// Minimizes over S = first_from_second, by Levenberg-Marquardt over 7 or 6 degrees of freedom,
//
//   1/2 sum_i rho(e1' W1 e1) + rho(e2' W2 e2) + rho(d^2)
//
//   e1 = (project(S * point_in_second) - seen_first) / sigma
//   e2 = (project(S^-1 * point_in_first) - seen_second) / sigma
//   W  = (I + a a')^-1,  a = de/d(ln depth) * depth_sigma: so much of e is owed to the depth of the point
//   d  = ln(z(S * point_in_second) / z(point_in_first)) / (sqrt(2) depth_sigma)          (where baseline_m is 0)
//
// with Huber's rho at the 95 % limits. The first round takes pairs up to three times the limit, for a rough start;
// after each, pairs are sorted anew. With fewer than 3 inliers the start comes back and num_inliers is 0; it is for the
// caller to judge num_inliers and rotation_sigma_rad. Throws std::invalid_argument with Check()'s sentence.
SimilarityEstimate RefineSimilarity(const CameraCalibration& calibration, std::span<const PointPair> pairs,
                                    const Sim3& first_from_second, const SimilarityOptions& options);

}  // namespace tessera
