// How the camera moved a moment ago, as a prior for how it moves now.
//
// The velocity v of the camera in its own frame (as it stands in the middle of a step) is a random walk, and what the
// poses show of it is noisy:
//
//   v(k+1) = v(k) + walk,  variance q dt an axis;     measured(k) = v(k) + noise,  variance r an axis
//
// A Kalman filter follows v. q and r are what the last seconds showed: with d(k) = measured(k) - measured(k-1),
//
//   E[d(k) d(k)] = q dt + 2 r,    E[d(k) d(k-1)] = -r                 (R. Mehra, "On the identification of variances
//   and
//                                                                      adaptive Kalman filtering", 1970)
//
// The turn rate goes on as it was, and is as uncertain as it changed from step to step in those seconds.
//
// All in time, not in frames, and in the units of the tracker's reference keyframe.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/rigid3.h"

namespace tessera {

struct MotionPrediction {
  Rigid3 last_from_current;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of its translation
  bool is_learned = false;                               // enough was seen to say where to look
  bool is_steady = false;       // and of a moving camera, to hold this against images: one that stands may start
  double turn_sigma_rad = 0.0;  // of its rotation, an axis, if the camera turns on as it did
};

class MotionModel {
 public:
  void Reset() { *this = {}; }
  // The camera moved so over `interval_s` > 0; `covariance`: of the translation, as the pose's optimization has it.
  // `is_carried`: the prediction took part in it, so that it tells nothing new about q and r.
  void Add(const Rigid3& last_from_current, const Eigen::Matrix3d& covariance, double interval_s,
           bool is_carried = false);
  // Before the first motion: about so, over `interval_s` > 0, which says where to look and nothing of q and r.
  void Guess(const Rigid3& last_from_current, double interval_s);
  // nullopt before the first motion or guess. The camera turns on as it did, or by `last_from_current`, if that is
  // known.
  std::optional<MotionPrediction> Predict(double interval_s) const;
  std::optional<MotionPrediction> Predict(double interval_s, const Eigen::Quaterniond& last_from_current) const;
  // How the camera moved in the middle of the last step, in its axes then, filtered; unknown before the first motion
  // or guess.
  bool is_known() const { return is_known_; }
  const Eigen::Vector3d& velocity() const { return velocity_; }    // units/s
  const Eigen::Vector3d& turn_rate() const { return turn_rate_; }  // rad/s

 private:
  void LearnNoise(const Eigen::Vector3d& measured, double interval_s);
  double MemoryShare(double interval_s) const;

  bool is_known_ = false;
  int num_motions_ = 0;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();   // units/s
  Eigen::Matrix3d variance_ = Eigen::Matrix3d::Zero();   // of it
  Eigen::Vector3d turn_rate_ = Eigen::Vector3d::Zero();  // rad/s, of the last motion
  double turn_change_variance_ = 0.0;                    // (rad/s)^2, an axis, from motion to motion
  Eigen::Vector3d measured_ = Eigen::Vector3d::Zero();   // the last velocity
  Eigen::Vector3d change_ = Eigen::Vector3d::Zero();     // d, to the one before
  double change_variance_ = 0.0;                         // of d, an axis
  double change_covariance_ = 0.0;                       // of d and the one before
  double noise_ = 0.0;                                   // r, (units/s)^2
  double walk_ = 0.0;                                    // q, units^2/s^3
};

// Whether this motion (last_from_current), its translation known to `covariance`, is more than five standard deviations
// an axis off.
bool IsJump(const MotionPrediction& prediction, const Rigid3& motion, const Eigen::Matrix3d& covariance);

// A pose against how the camera moved a moment ago.
enum class MotionAgreement {
  kOpen,    // nothing says more
  kGoesOn,  // a camera that moved steadily does so still
  kJumps    // the camera can't have come there
};

// What images say about a step against what was predicted.
enum class StepEvidence {
  kStrong,  // they fix the step, or nothing steady was predicted
  kWeak,    // they leave its length open: a standard deviation along it of more than a fifth of it; or, of a camera
            // that stands, where it is, more than the prediction does
  kContradictory  // they fix another step, which a camera that moved as this one did a moment ago can't make
};

// `by_images` and `covariance`: the motion (last_from_current) and its translation's covariance by images alone. A
// contradiction is a jump that changes the length along the prediction by a third at least.
StepEvidence Judge(const MotionPrediction& prediction, const Rigid3& by_images, const Eigen::Matrix3d& covariance);

}  // namespace tessera
