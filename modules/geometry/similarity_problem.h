// The least squares of two keyframes' similarity. Only geometry/similarity.cc includes this file.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <span>
#include <vector>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"
#include "geometry/similarity.h"

namespace tessera {

inline constexpr int kMinSimilarityInliers = 3;  // points that fix seven degrees of freedom

// The pairs of RefineSimilarity's sum, with weights that are brought up to date each round. See there for the
// equations.
class SimilarityProblem {
 public:
  SimilarityProblem(const CameraCalibration& calibration, std::span<const PointPair> pairs,
                    const SimilarityOptions& options);

  // The estimate with pairs sorted by `factor` times the squared limits. Weights are from here on as of this one.
  SimilarityEstimate Classify(const Sim3& first_from_second, double factor);
  SimilarityEstimate Refine(const Sim3& first_from_second, int num_rounds, double first_factor);
  // Of the worst axis, from the information of the inliers.
  double RotationSigma(const SimilarityEstimate& estimate) const;

 private:
  // What one keyframe sees of the other's points.
  struct Sights {
    std::vector<Eigen::Vector3d> points;   // landmarks in the frame of the keyframe that knows them
    std::vector<PixelObservation> seen;    // by the other
    std::vector<double> depth_sigmas;      // of `points`, as a fraction of the depth
    std::vector<Eigen::Vector3d> spreads;  // d(residual)/d(ln depth) * depth_sigma, as of the last Classify
  };
  struct Linear;

  void Append(const Eigen::Vector3d& point, const PixelObservation& seen_with_it, PixelObservation seen_by_other,
              Sights& sights) const;
  // ln of the ratio of the two depths that a pair gives its landmark, in standard deviations; both positive.
  double DepthResidual(double moved_z, double z) const {
    return std::log(moved_z / z) / (std::sqrt(2.0) * options_.depth_sigma);
  }
  // Where right columns are seen, they tell of depth, and better.
  bool UsesDepths() const { return !(options_.baseline_m > 0.0); }
  bool Fits(const Sim3& viewer_from_owner, double factor, size_t i, Sights& sights) const;
  // Half the robust cost of one pair in one direction; infinite behind the camera.
  double Cost(const Eigen::Vector3d& point_in_viewer, size_t i, const Sights& sights) const;
  double Cost(const SimilarityEstimate& estimate) const;
  Linear Linearize(const SimilarityEstimate& estimate) const;
  // Moves the estimate to the minimum over its inliers, which must be in front of both cameras.
  void Minimize(SimilarityEstimate& estimate) const;

  const CameraCalibration& calibration_;
  const SimilarityOptions& options_;
  const size_t num_pairs_;
  Sights in_first_;  // points of the second keyframe, seen by the first
  Sights in_second_;
};

}  // namespace tessera
