// How the camera moved a moment ago, as a prior for how it moves now.
//
// The velocity v of the camera in its own frame is a random walk: between two moments dt apart it changes by a normal
// amount of variance q dt an axis. q is what the last seconds showed. With P the variance of the present v,
//
//   translation over the next dt = v dt,   covariance = (P + q dt I) dt^2
//
// All in time, not in frames, and in the units of the tracker's reference keyframe. A Kalman filter whose measurements
// are the poses that images and prior gave together (pose_optimization.h), so that images which say little about the
// translation leave v as it was.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/rigid3.h"

namespace tessera {

struct MotionPrediction {
  Rigid3 last_from_current;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of its translation
  bool is_steady = false;                                // enough was seen to trust it where images say less
};

class MotionModel {
 public:
  void Reset() { *this = {}; }
  // The camera moved so over `interval_s` > 0; `covariance`: of the translation.
  void Add(const Rigid3& last_from_current, const Eigen::Matrix3d& covariance, double interval_s);
  // nullopt before the first motion.
  std::optional<MotionPrediction> Predict(double interval_s) const;

 private:
  int num_motions_ = 0;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();   // units/s
  Eigen::Vector3d turn_rate_ = Eigen::Vector3d::Zero();  // rad/s
  Eigen::Matrix3d variance_ = Eigen::Matrix3d::Zero();   // P, (units/s)^2
  double walk_ = 0.0;                                    // q, units^2/s^3
};

// Whether images alone leave the length of the step so uncertain (standard deviation along it of more than a fifth of
// it) that the prediction should carry it. `covariance`: of the translation, by images alone.
bool IsStepWeak(const MotionPrediction& prediction, const Eigen::Matrix3d& covariance);

}  // namespace tessera
