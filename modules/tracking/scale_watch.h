// By how much the scale of mono may have changed, as far as the images leave it open.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>

#include "core/ids.h"

namespace tessera {

// What follows a step lies on the scale of that step: its points are triangulated from it. So the errors of the steps
// from keyframe to keyframe, along them, add up in the logarithm of the scale. Taken as independent, their variance is
//
//   drift^2 = sum over keyframes of step' covariance step / |step|^4  =  sum of (sigma_step / |step|)^2
//
// Where near points are seen, it grows by some percent a minute. Where the view holds hardly any, a second is enough
// for a factor of two, while all residuals stay small.
//
// A camera that stands makes keyframes, too, when something passes in front of it. Their steps are far less than their
// errors, but nothing is triangulated from them: most points are known from before, and hold the scale. Such a step
// doesn't count, and the next one begins where it began.
class ScaleWatch {
 public:
  // A new part of the map begins, with a scale of its own.
  void Restart() { *this = {}; }
  // The camera was found at a keyframe of the map: its next step begins there.
  void GoOnFrom(KeyframeId keyframe) { since_ = keyframe; }
  // `step`: the camera's way to this keyframe from since(), or else from the last one, in its own axes; `covariance`:
  // of it, by images alone; `known_share`: of the points with depth that it sees, those that were known there.
  void Add(KeyframeId keyframe, int64_t utime_us, const Eigen::Vector3d& step, const Eigen::Matrix3d& covariance,
           double known_share);
  // Where the step begins that is under way; invalid: nowhere yet.
  KeyframeId since() const { return since_; }

  // Standard deviations of the logarithm: since the part began, without regard to loops, and over the kRecent_us that
  // end at `utime_us`.
  double drift() const;
  double RecentDrift(int64_t utime_us) const;

  static constexpr int64_t kRecent_us = 4'000'000;

 private:
  struct Step {
    int64_t utime_us = 0;
    double variance = 0.0;
  };
  KeyframeId since_;
  double variance_ = 0.0;
  std::deque<Step> recent_;
};

}  // namespace tessera
