// Pose graph optimization: distributes the error of loops over keyframes by their relative poses, without landmarks.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/ids.h"
#include "core/result.h"
#include "geometry/rigid3.h"

namespace tessera {

struct PoseGraphNode {
  KeyframeId id;             // for the caller; the solver goes by index
  Sim3 world_from_keyframe;  // scale: units of the world for one unit of the keyframe's surroundings
  bool is_fixed = false;     // held where it is: the gauge
};

// A measured relative pose of two keyframes: point_in_to = to_from_from * point_in_from.
struct PoseGraphEdge {
  int from = -1;  // indices into PoseGraphProblem::nodes
  int to = -1;
  Sim3 to_from_from;
  double weight = 1.0;  // of the squared residual; two edges alike are one of weight 2
  // The unit of translation errors, in units of `from`: the median depth of the landmarks that `from` observes or,
  // without landmarks, the distance of the two keyframes. It makes the result independent of the map's unit.
  double length = 1.0;
  // Of the error, on top of what PoseGraphOptions says of every edge: tangent (translation, rotation [rad], logarithm
  // of scale) in the axes and units of `from`.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
};

struct PoseGraphProblem {
  std::vector<PoseGraphNode> nodes;
  std::vector<PoseGraphEdge> edges;
  bool has_scale = true;  // mono: Sim(3); false: SE(3), all scales stay as given, to the bit

  // Fails unless indices are in range, a node is fixed, and weights, lengths and scales are positive.
  Result<> Check() const;
};

struct PoseGraphOptions {
  int max_num_iterations = 20;       // Levenberg-Marquardt steps; a loop of 3000 keyframes takes 5 to 10
  double function_tolerance = 1e-5;  // ends when a step lowers the cost by less than this part of it
  // Standard deviations of the error of every edge, by what its covariance doesn't know of. Where edges have none, only
  // the ratios matter (README.md).
  double translation_sigma = 0.001;  // in units of PoseGraphEdge::length
  double rotation_sigma_rad = 0.0001;
  double log_scale_sigma = 0.001;

  // Fails if a value is out of range.
  Result<> Check() const;
};

// Minimizes over the free S = world_from_keyframe, in Ceres (sparse Cholesky),
//
//   1/2 sum_edges weight * r' (covariance + diag(length translation_sigma, rotation_sigma_rad, log_scale_sigma)^2)^-1 r
//   r = (t, log(R), ln(s))
//   (s, R, t) = to_from_from^-1 * (S_to^-1 * S_from)                        what is measured^-1 * what is predicted
//
// after H. Strasdat, J. M. M. Montiel, A. Davison, "Scale Drift-Aware Large Scale Monocular SLAM", RSS 2010; (t, log R,
// ln s) equals the logarithm of Sim(3) that is used there to first order. Without scale r has six rows.
//
// Returns world_from_keyframe by node; fixed nodes, and those that no chain of edges connects with a fixed one, to the
// bit as given. A pure function of the values given. Throws std::invalid_argument with Check()'s sentence where problem
// or options are malformed. nullopt where nothing is free, a value is not finite, or the solver found no step.
std::optional<std::vector<Sim3>> OptimizePoseGraph(const PoseGraphProblem& problem, const PoseGraphOptions& options);

// What is minimized, at world_from_keyframe by node. If all edges but one loop's measure where the nodes were, twice
// the minimum is the chi-square, of at most 7 degrees of freedom, by which they contradict the loop.
double PoseGraphCostAt(const std::vector<Sim3>& world_from_keyframe, const PoseGraphProblem& problem,
                       const PoseGraphOptions& options);

}  // namespace tessera
