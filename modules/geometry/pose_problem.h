// The normal equations of a camera's pose, for pose_optimization.h: its equation stands there.
//
// An observation takes part in some twenty steps of a frame's pose, so four of them are computed at once, each number
// of theirs in a lane. The order of operations doesn't depend on the processor.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "geometry/pose_optimization.h"

namespace tessera {

class PoseProblem {
 public:
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  using Vector6d = Eigen::Matrix<double, 6, 1>;

  // `prior` (nullptr: none) must outlive it. `camera_from_world`: the start.
  PoseProblem(const CameraCalibration& calibration, double baseline_m, std::span<const PoseObservation> observations,
              const Rigid3& camera_from_world, const PosePrior* prior);

  // One Gauss-Newton step of the pose with all depths eliminated; they are moved along. nullopt if it isn't finite.
  std::optional<Vector6d> Step(const Rigid3& camera_from_world, Matrix6d* information);
  // Sorts into inliers and outliers, each at the depth that suits it best; returns how many inliers.
  int Classify(const Rigid3& camera_from_world);

  std::vector<char> is_inlier() const;  // by observation
  double rms() const { return rms_; }   // of the inliers' whitened residuals

 private:
  static constexpr size_t kLanes = 4;
  using Four = double __attribute__((vector_size(kLanes * sizeof(double))));

  // Four observations. Lanes that hold none are never inliers.
  struct Pack {
    Four point[3] = {};
    Four depth_sigma[3] = {};
    Four pixel_x = {}, pixel_y = {}, right_x = {};
    Four weight = {}, right_weight = {};  // 1 / sigma; 0: no right column
    Four is_column = {};                  // 1: the right column was found by itself; 0: the disparity was measured
    Four chi2_limit = {};                 // negative: no observation
    Four freedom = {};                    // numbers that it measures
    Four relative_sigma = {};             // of the inverse depth
    Four u = {};                          // standard deviations that the inverse depth is off
    Four is_inlier = {};                  // 1 or 0
    Four votes = {};                      // 1: takes part in steps; 0: is classified only
  };
  // The whitened residual, by the point in the camera's frame and by u:
  //
  //   d(residual)/d(point) = | x_x  0    x_z |     d(residual)/du = (by_u[0], by_u[1], by_u[2])
  //                          | 0    y_y  y_z |
  //                          | r_x  0    r_z |
  struct Linearization {
    Four point[3];   // in the camera's frame
    Four is_active;  // stands before the camera
    Four residual[3];
    Four x_x, x_z, y_y, y_z, r_x, r_z;
    Four by_u[3];
  };
  // What gives u from the step of the pose.
  struct Eliminated {
    Four point[3];
    Four coupling[3];  // of u with the point's motion
    Four curvature, gradient;
    Four is_active;
  };
  struct NormalEquations;

  void SetLane(Pack& pack, size_t lane, const PoseObservation& observation, const Eigen::Vector3d& camera_in_world);
  Linearization Linearize(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation, const Pack& pack) const;
  Eliminated Add(const Linearization& linear, const Pack& pack, NormalEquations& equations) const;

  const PosePrior* prior_;
  const CameraCalibration& calibration_;
  double baseline_m_;
  std::vector<size_t> lane_of_;  // by observation, counted over all packs: those that vote come first
  size_t num_voting_packs_ = 0;  // steps need no others
  std::vector<Pack> packs_;
  std::vector<Eliminated> eliminated_;  // by pack
  // Of the last step, its observations alone: the inverse of their information about the translation; zero before it.
  Eigen::Matrix3d known_translation_ = Eigen::Matrix3d::Zero();
  double max_leverage_ = 1.0;
  double rms_ = 0.0;
};

}  // namespace tessera
