// The residual of a pose graph's edge as Ceres wants it. Only this module's sources and its tests include this file.
//
// As in bundle_costs.h a node is optimized as a plain vector, its change since the solve began:
//
//   world_from_keyframe = (scale e^c, Exp(w) rotation, translation + v),   tangent (v, w) or (v, w, c)
//
// Translations add in the world's frame, so that for given rotations and scales the residual of translation is linear
// in all of them: after a large loop that is what lets the first steps be long.
#pragma once

#include <ceres/evaluation_callback.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <span>

#include "geometry/rigid3.h"
#include "optimization/pose_graph.h"

namespace tessera {

// A node while Ceres moves it.
struct MovingNode {
  Sim3 base;                        // world_from_keyframe at tangent zero
  const double* tangent = nullptr;  // Ceres' 7 or 6 parameters
  bool has_scale = true;            // whether there is a seventh

  // As of the last Update().
  Sim3 world_from_keyframe;
  Eigen::Matrix3d rotation;
  Eigen::Matrix3d left_jacobian;  // at w

  void Update();
};

// Brings all nodes up to date before Ceres evaluates residuals.
class NodeUpdater final : public ceres::EvaluationCallback {
 public:
  explicit NodeUpdater(std::span<MovingNode> nodes) : nodes_(nodes) {}
  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  std::span<MovingNode> nodes_;
};

// kSize: 7 with scale, 6 without, of residual and tangents alike; parameters: the tangents of `from` and `to`.
// Referenced values must outlive the cost.
template <int kSize>
class PoseGraphCost final : public ceres::SizedCostFunction<kSize, kSize, kSize> {
 public:
  PoseGraphCost(const PoseGraphEdge& edge, const PoseGraphOptions& options, const MovingNode& from,
                const MovingNode& to);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const Sim3 from_from_to_;                  // measured
  const Eigen::Matrix3d measured_rotation_;  // of from_from_to_
  Eigen::Matrix<double, kSize, kSize> whitening_;
  const MovingNode& from_;
  const MovingNode& to_;
};

}  // namespace tessera
