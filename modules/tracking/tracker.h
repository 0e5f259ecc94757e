// Visual odometry: the pose of each frame against a map of landmarks that it builds on its way.
//
// Landmarks are matched with keypoints by projection, the pose is the one that explains the matches best, and at
// keyframes new landmarks are triangulated and known ones estimated anew. A pose, once told, is not changed. The world is
// the camera frame of the first keyframe: x right, y down, z forward; for mono in units of its median depth.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "map/tracking_types.h"
#include "tracking/tracker_options.h"

namespace tessera {

struct TrackingResult {
  PoseEstimate pose;
  std::vector<KeyframeObservation> keyframes;  // made of this frame: none or one; or the two that mono starts from
  int64_t num_keyframes = 0;                   // in the map
};

class Tracker {
 public:
  // Throws std::invalid_argument with the options' Check().
  explicit Tracker(const TrackerOptions& options);

  // Frames in the order of their numbers; some may be missing. A pure function of the frames so far.
  TrackingResult Track(const FeatureFrame& features);

 private:
  using Frame = std::shared_ptr<const FrameView>;

  // A located frame: `inliers` refer to local_.
  std::optional<FoundPose> Locate(const FrameView& frame);
  std::optional<Rigid3> GuessByMotion(const FrameView& frame) const;
  std::optional<Rigid3> GuessByKeyframes(const FrameView& frame);
  Rigid3 Predict(const FrameView& frame) const;
  void CountSeen(const FoundPose& found);

  std::optional<FoundPose> Begin(const Frame& frame);
  bool BeginFromTwoViews(const Frame& frame);
  bool BeginFromRight(const Frame& frame);

  bool IsKeyframeDue(const FrameView& frame, const FoundPose& found) const;
  double MedianParallax(const FoundPose& found) const;
  void MakeKeyframe(const Frame& frame, const FoundPose& found);
  void SelectLocalMap(KeyframeId center);
  void ForgetOldKeyframes();

  void Remember(const FrameView& frame, const FoundPose& found);
  TrackingResult Report(const FrameView& frame, const std::optional<FoundPose>& found, int64_t first_new) const;

  TrackerOptions options_;
  OdometryMap map_;
  MonoInitializer initializer_;

  KeyframeId reference_;              // the keyframe that poses are told relative to
  std::vector<LocalLandmark> local_;  // landmarks around it, which frames are searched for
  size_t most_seen_ = 0;              // landmarks in one frame since that keyframe

  // The last located frame.
  FrameId last_frame_;
  Rigid3 last_camera_from_world_;
  std::vector<LocalLandmark> last_seen_;
  Rigid3 motion_;               // camera_from_world moved on by one frame: now = motion_ * before
  int64_t num_lost_ = 0;        // frames without a pose since
};

}  // namespace tessera
