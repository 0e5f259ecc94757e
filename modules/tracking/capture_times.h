// A frame isn't taken at one time: the rows of a rolling shutter are read one after another, and a depth camera or a
// right camera that isn't triggered with the color or left camera measures before or after it. The camera doesn't tell
// by how much. It is learned from frame to frame, and taken out by how the camera moved.
#pragma once

#include <memory>
#include <optional>

#include "measurement/depth_delay.h"
#include "measurement/rolling_shutter.h"
#include "tracking/depth_delay_estimator.h"
#include "tracking/readout_estimator.h"
#include "tracking/right_delay_estimator.h"

namespace tessera {

// As the camera took it.
struct CapturedFrame {
  std::shared_ptr<const FrameView> view;
  double depth_delay_s = 0.0;  // by how much later depths were measured; 0: too little to matter
  DepthSurfaces surfaces;      // if it matters
};

class CaptureTimes {
 public:
  using Frame = std::shared_ptr<const FrameView>;
  // How the camera moved from the last frame to one that follows it.
  struct Step {
    Rigid3 last_from_current;  // in units of the world
    double interval_s = 0.0;   // > 0
  };

  CapturedFrame Captured(const FeatureFrame& features, const LensCorrection& lens) const;

  // As the keypoints would be seen, by both eyes, and their depths measured, if all of it were done at the frame's
  // time. Keypoints
  // whose depth nobody knows are as far away as the points of `last`, the last frame, usually are.
  // Before the frame's step is known: if the camera moves on as it did.
  Frame AtOneTime(const CapturedFrame& captured, const TrackedFrame& last) const;
  // By the step that led to the frame; nullopt: unknown, and nothing is moved. `tracked`: the frame at its pose, whose
  // points tell the depths of keypoints.
  Frame AtOneTime(const CapturedFrame& captured, const TrackedFrame& last, const TrackedFrame& tracked,
                  const std::optional<Step>& step) const;

  // A step further.
  void Follow(const std::optional<Step>& step);
  // The frame that this step led to was moved to one time, and tracked; outliers are removed.
  void Learn(const TrackedFrame& tracked, const Rigid3& world_from_reference, const MapReplica& replica);
  // The last frame is this keyframe, the reference of those to come.
  void BecomeReference(KeyframeId id);
  // How the camera moves is unknown. What was learned of the times stays.
  void ForgetMotion();

  // What was learned of the camera: see ReadoutEstimator, DepthDelayEstimator, RightDelayEstimator.
  Readout readout() const { return readout_.readout(); }
  double depth_delay_s() const { return depth_delay_.delay_s(); }
  double right_delay_s() const { return right_delay_.delay_s(); }

 private:
  // Of two frames so far apart. The farther they are, the less is it the motion while one of them was taken.
  struct KnownMotion {
    CameraMotion motion;  // in units of the world
    double interval_s = 0.0;

    bool is_fine() const;  // tells how the camera moved while an image was read or depths were measured
  };

  static std::optional<KnownMotion> MeanMotion(const std::optional<Step>& step);
  std::optional<KnownMotion> MotionAtEnd(const std::optional<Step>& step) const;
  Frame Moved(const CapturedFrame& captured, const TrackedFrame& last, const TrackedFrame& tracked,
              const std::optional<KnownMotion>& known) const;
  FeatureFrame Unrolled(const FeatureFrame& rolled, const TrackedFrame& last, const TrackedFrame& tracked,
                        const CameraMotion& motion) const;

  ReadoutEstimator readout_;
  DepthDelayEstimator depth_delay_;
  RightDelayEstimator right_delay_;
  // nullopt: unknown
  std::optional<KnownMotion> mean_motion_;          // over the last step
  std::optional<KnownMotion> motion_;               // while the last frame was taken
  std::optional<KnownMotion> motion_at_reference_;  // likewise
};

}  // namespace tessera
