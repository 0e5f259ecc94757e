// The residuals of bundle adjustment as Ceres wants them. Only this module's sources and its tests include this file.
//
// A pose is optimized as a tangent (v, w) at the pose where the solve began (MoveBy), so that Ceres sees plain vectors.
// Corrections are far below half a turn, where this is a chart without seams. Seen from the world a camera's center
// moves straight, by v, and w turns the camera where it is. A whole street that is deformed, cameras and points, is
// then nearly linear in the parameters, and steps along it can be long; with Retract, where w turns v as well, the
// first steps after a loop are many times shorter (README.md). What depends on the pose alone is computed once an
// evaluation (EvaluationCallback), not once an observation.
#pragma once

#include <ceres/evaluation_callback.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <span>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"
#include "optimization/bundle_adjustment.h"

namespace tessera {

// A residual behind the camera, in sigmas: constant, so that nothing draws a point there, and finite.
inline constexpr double kBehindResidual = 100.0;

// Trust regions grow no larger: mono's scale has no curvature of its own, only what damping gives, and below a part of
// 1e-10 of the diagonal rounding would leave the matrix indefinite.
inline constexpr double kMaxRadius = 1e10;

// J with Exp(w + dw) = Exp(J dw) Exp(w) to first order: the left Jacobian of SO(3); |w| < 2 pi.
Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& omega_rad);

// camera_from_world moved by the tangent (v, w), each in the frame of the camera before:
//
//   point_in_camera' = Exp(w) (camera_from_world * point_in_world + v)
Rigid3 MoveBy(const Rigid3& camera_from_world, const Eigen::Matrix<double, 6, 1>& tangent);

// A pose while Ceres moves it.
struct MovingPose {
  Rigid3 base;                      // camera_from_world at tangent zero
  const double* tangent = nullptr;  // (v, w): Ceres' 6 parameters

  // Of camera_from_world, as of the last Update().
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  Eigen::Matrix3d turn;           // Exp(w)
  Eigen::Matrix3d left_jacobian;  // at w

  void Update();
  Rigid3 CameraFromWorld() const;
};

// Brings all poses up to date before Ceres evaluates residuals.
class PoseUpdater final : public ceres::EvaluationCallback {
 public:
  explicit PoseUpdater(std::span<MovingPose> poses) : poses_(poses) {}
  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  std::span<MovingPose> poses_;
};

// e = (project(camera_from_world * point) - pixel) / sigma_px; parameters: point, then the pose's tangent in blocks of
// the given sizes. Block sizes are chosen for the Schur eliminators that Ceres has compiled with fixed sizes, (2, 3, 6)
// and (3, 3, 3): a dynamic one takes twice the time. Referenced values must outlive the cost.
template <int kRows, int... kPoseBlocks>
class ReprojectionCost final : public ceres::SizedCostFunction<kRows, 3, kPoseBlocks...> {
 public:
  ReprojectionCost(const BundleProblem& problem, const PixelObservation& seen, const MovingPose& pose)
      : problem_(problem), seen_(seen), pose_(pose) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const BundleProblem& problem_;
  const PixelObservation& seen_;
  const MovingPose& pose_;
};
using MonoReprojectionCost = ReprojectionCost<2, 6>;
// The third row is zero for an observation without a right column, so that a mixed problem keeps one block size.
using StereoReprojectionCost = ReprojectionCost<3, 3, 3>;

// The residual of a constraint and its derivatives by left perturbations (Retract's tangents) of the two poses:
//
//   L' r  with  information = L L'  and  to * from^-1 = Retract(to_from_from, r)
class RelativePoseTerm {
 public:
  struct Linear {
    Eigen::Matrix<double, 6, 1> residual;
    Eigen::Matrix<double, 6, 6> by_from;
    Eigen::Matrix<double, 6, 6> by_to;
  };

  explicit RelativePoseTerm(const RelativePoseConstraint& constraint);
  // Both poses camera_from_world.
  Eigen::Matrix<double, 6, 1> Residual(const Rigid3& from, const Rigid3& to) const;
  Linear Linearize(const Rigid3& from, const Rigid3& to) const;

 private:
  Rigid3 from_from_to_;
  Eigen::Matrix<double, 6, 6> square_root_information_;  // L'
};

// The same for Ceres; parameters: the tangents of `from` and `to`, each in blocks of kBlock.
template <int kBlock, int... kPoseBlocks>
class RelativePoseCost final : public ceres::SizedCostFunction<6, kBlock, kPoseBlocks...> {
 public:
  RelativePoseCost(const RelativePoseConstraint& constraint, const MovingPose& from, const MovingPose& to)
      : term_(constraint), from_(from), to_(to) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  const RelativePoseTerm term_;
  const MovingPose& from_;
  const MovingPose& to_;
};
using WholeRelativePoseCost = RelativePoseCost<6, 6>;
using SplitRelativePoseCost = RelativePoseCost<3, 3, 3, 3>;

}  // namespace tessera
