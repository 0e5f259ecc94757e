// Whether something that moves hides the scene.
//
// A bus that passes close by, or a person, fills the image within some frames. Its points are many and agree with one
// another, so the pose by them is one of a camera that moves the other way. What tells it apart are the confirmed
// points (confirmed_points.h), which stood still for long: they contradict that pose, or are gone from one moment to
// the next while the camera would have jumped. From then on only they say when the scene is back. But a pose that a
// camera which moved steadily goes on to is that of the scene: among vehicles that drive as fast as it does, confirmed
// points may be theirs.
#pragma once

#include <cstdint>
#include <optional>

#include "tracking/step_pose.h"

namespace tessera {

class HiddenScene {
 public:
  // Also for some time after the scene was seen again: what hid it may do so once more.
  bool is_hidden() const { return hidden_us_.has_value(); }
  // Whether there have been confirmed points: without, nothing tells what hides the scene from the scene.
  bool is_known() const { return confirmed_us_.has_value(); }
  // Whether confirmed points agreed with a pose a moment ago.
  bool WasConfirmed(int64_t utime_us) const;

  // Whether this pose is that of something else than the scene.
  bool IsBehind(const StepPose& pose, MotionAgreement agreement, int64_t utime_us) const;
  // Whether so many confirmed points agree that the pose is right, however much of the scene is hidden.
  bool IsSure(const StepPose& pose, MotionAgreement agreement, int64_t utime_us) const;

  // At each frame that shows something else, or nothing; longer than kMaxHidden_us, what hides the scene is the scene.
  void Hide(int64_t utime_us) { hidden_us_ = utime_us; }
  // At each frame with a pose.
  void See(const StepPose& pose, int64_t utime_us);
  // The camera was found, or another part of the map begins.
  void EndHiding() { hidden_us_.reset(); }

  static constexpr int64_t kMaxHidden_us = 10'000'000;

 private:
  std::optional<int64_t> confirmed_us_;  // of the last frame whose pose confirmed points agreed with
  double confirmed_share_ = 0.0;         // of the points that did
  std::optional<int64_t> hidden_us_;     // of the last frame that didn't show the scene
};

}  // namespace tessera
