// The tracker's step: one frame's features in, its pose and perhaps a keyframe out, in a map that the mapper owns and
// that changes here by deltas. No bus, no clock.
//
// The last frame's points are matched around a constant-velocity prediction, then the landmarks of the local keyframes;
// after each, the pose is optimized over the matches. Between a keyframe and the delta that answers it, the points that
// the tracker triangulated itself are used: mono's first ones, and those with depth.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/pose_optimization.h"
#include "measurement/depth_points.h"
#include "messages/loop_types.h"
#include "messages/tracking_types.h"
#include "tracking/capture_times.h"
#include "tracking/frame_search.h"
#include "tracking/ground_watch.h"
#include "tracking/hidden_scene.h"
#include "tracking/initializer.h"
#include "tracking/keyframe_decision.h"
#include "tracking/localized_frame.h"
#include "tracking/lost_way.h"
#include "tracking/map_replica.h"
#include "tracking/motion_model.h"
#include "tracking/moving_things.h"
#include "tracking/own_body.h"
#include "tracking/part_start.h"
#include "tracking/reference_keyframe.h"
#include "tracking/repeated_images.h"
#include "tracking/scale_watch.h"
#include "tracking/step_pose.h"
#include "tracking/way_corrections.h"

namespace tessera {

struct MapTrackerOptions {
  // Points far ahead have little parallax, but they last longest: less than the usual parallax will do for a start.
  InitializerOptions start{.two_view = {.min_points = 100, .min_parallax_rad = 0.005}};
  FrameSearchOptions search;
  KeyframeDecisionOptions keyframes;
  int min_start_points = 150;        // stereo, RGB-D: keypoints with depth that a first keyframe needs
  int min_inliers = 25;              // points that a pose must agree with
  double min_share_of_last = 0.1;    // of the last frame's points: fewer from one frame to the next are there by chance
  int min_relocalized_inliers = 50;  // likewise after a loss, where chance has more room
  int64_t max_lost_us = 1500000;     // after so long without a pose, a new part of the map begins
  int64_t max_unlocated_us = 0;      // the same before the first pose in a map that was loaded, if that is longer
  bool makes_keyframes = true;       // false: the map is used as it is, and no part is begun
  int max_unanswered_keyframes = 8;  // live: a mapper that is far behind isn't helped by more of them
  DepthPointOptions depth;           // stereo, RGB-D: which keypoints make points at once

  Result<> Check() const;
};

struct MapTrackingResult {
  PoseEstimate pose;
  // Nothing is decided yet: the frame can't be localized from what is around the last one. To be tracked again, with an
  // answer or without.
  bool asks_relocalization = false;
  std::vector<KeyframeObservation> keyframes;  // made of this frame: none or one; or the two that mono starts from
};

class MapTracker {
 public:
  // Throws std::invalid_argument with Check()'s sentence.
  explicit MapTracker(const MapTrackerOptions& options);

  // Applies the mapper's next change to the replica; fails as Map::Apply does.
  Result<> ApplyDelta(const MapDelta& delta);
  // Frames in the order of their numbers; some may be missing. A pure function of the frames, deltas and answers so
  // far. `answer`: where this frame, or the one that asked last, was taken. `may_ask`: an answer can be had for this
  // frame.
  MapTrackingResult Track(const FeatureFrame& features, const RelocalizationAnswer* answer = nullptr,
                          bool may_ask = false);
  // The last keyframe sent: what a request is about.
  KeyframeId last_keyframe() const { return {next_keyframe_.value - 1}; }

  const Map& map() const { return replica_.map(); }
  // Mono: by how much the scale may have drifted since this part of the map began (ScaleWatch::drift). 0 where depth is
  // measured.
  double scale_drift() const { return scale_.drift(); }
  // What moves with the camera; its keypoints take no part.
  const OwnBody& own_body() const { return own_body_; }
  // Images that were those before, once more.
  int64_t num_repeated() const { return repeated_.num(); }
  // What was learned of the camera.
  const CaptureTimes& times() const { return times_; }

 private:
  using Frame = std::shared_ptr<const FrameView>;

  //   kInitializing -> kTracking           the first frame with depth, or pair of frames, starts the map
  //   kTracking -> kLost                   a frame can't be localized
  //   kLost -> kTracking                   one can, or a new part of the map starts after max_lost_us
  enum class State { kInitializing, kTracking, kLost };
  State state() const;
  bool has_map() const { return replica_.map().keyframes().size() > 0; }
  Sim3 WorldFromReference() const { return reference_.WorldFromKeyframe(replica_); }

  // KeyframeObservation::mendings.
  struct SentMending {
    KeyframeId keyframe;  // that brings them
    KeyframeId since;     // that the last of them names
  };

  void Watch(const FeatureFrame& features);
  std::optional<ExpectedMotion> ExpectMotion(int64_t utime_us) const;
  void UpdateLast();
  bool TakeAnswer(const RelocalizationAnswer& answer, const Frame& view);
  bool CanAskFor(const FrameView& view) const;

  std::optional<ExpectedStep> ExpectStep(const FrameView& view,
                                         const std::optional<Eigen::Quaterniond>& last_from_current = {}) const;
  ExpectedFrame Expect(const FrameView& view) const;
  bool Localize(const CapturedFrame& captured, FrameSearch& search);
  StepPose OptimizeWithMotion(TrackedFrame& frame) const;
  int MinInliers(int num_matches) const;
  bool IsOnItsWay(const FrameView& view) const;
  // The motion of a moment ago still says where the camera may be.
  bool IsFollowed() const { return !lost_since_us_ || scene_.is_hidden(); }
  MotionAgreement AgreementOf(const FrameView& view, const Rigid3& world_from_camera,
                              const Matrix6d& information) const;
  std::optional<CaptureTimes::Step> StepTo(const TrackedFrame& frame) const;
  void Remember(TrackedFrame frame, const StepPose& pose, bool is_wide_step, int num_outliers);
  bool FollowPair(FrameSearch& search, std::vector<KeyframeObservation>& keyframes);

  bool Start(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  bool StartFromDepth(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  bool StartFromPair(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  bool NoteLoss(const Frame& view);
  bool StoodStill() const;
  void BeginLostWay();
  void ForgetMotion();

  bool IsKeyframeDue();
  KeyframeObservation MakeKeyframe(LocalizedFrame& localized);
  std::vector<LandmarkId> LandmarksOnBody(KeyframeId keyframe);
  void WatchScale();
  void WatchGround(const TrackedFrame& frame, const CaptureTimes::Step& step, const StepPose& pose);

  MapTrackingResult UndecidedResult(const FeatureFrame& features, int num_features) const;
  bool MayKeepPose(int64_t utime_us) const;
  MapTrackingResult KeepPose(const FeatureFrame& features);
  void CountPoints(PoseEstimate& pose) const;
  void DescribePose(MapTrackingResult& result);
  BodyState DescribeBody() const;

  const MapTrackerOptions options_;
  MapReplica replica_;
  CameraCalibration calibration_;  // that the source's frames bring
  PartStart start_;
  KeyframeDecision decision_;
  std::optional<LocalizedFrame> last_;  // that was tracked; nullopt: no part of the map is followed
  MotionModel motion_;                  // in the reference's units
  CaptureTimes times_;
  RepeatedImages repeated_;
  OwnBody own_body_;
  MovingThings moving_things_;
  FrameId watched_frame_;        // the last that both were shown
  int num_body_told_ = 0;        // OwnBody::num_found() when its landmarks were named
  KeyframeId tells_body_until_;  // keyframes on their way may bring more of them
  KeyframeId next_keyframe_{0};
  ReferenceKeyframe reference_;
  WayCorrections way_corrections_;
  ScaleWatch scale_;                         // mono
  GroundWatch ground_;                       // mono; in units of the world
  std::optional<SentMending> mending_;       // on its way to the mapper
  int64_t previous_utime_us_ = 0;            // of the frame before
  std::optional<int64_t> tracked_utime_us_;  // of the last frame with a pose
  std::optional<int64_t> lost_since_us_;
  HiddenScene scene_;
  LostWay lost_way_;  // since the last frame with a pose
  Frame asked_;       // the frame that asked last
};

}  // namespace tessera
