// The tracker's step: one frame's features in, its pose and perhaps a keyframe out, in a map that the mapper owns and
// that changes here by deltas. No bus, no clock.
//
// The last frame's points are matched around a constant-velocity prediction, then the landmarks of the local keyframes;
// after each, the pose is optimized over the matches. Between a keyframe and the delta that answers it, the points that
// the tracker triangulated itself are used: mono's first ones, and those with depth.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "geometry/pose_optimization.h"
#include "measurement/depth_delay.h"
#include "measurement/depth_points.h"
#include "messages/loop_types.h"
#include "messages/tracking_types.h"
#include "tracking/depth_delay_estimator.h"
#include "tracking/frame_search.h"
#include "tracking/ground_watch.h"
#include "tracking/initializer.h"
#include "tracking/keyframe_decision.h"
#include "tracking/map_replica.h"
#include "tracking/motion_model.h"
#include "tracking/pose_covariance.h"
#include "tracking/readout_estimator.h"
#include "tracking/scale_watch.h"
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
  // What was learned of the camera: see ReadoutEstimator, DepthDelayEstimator.
  double readout_s() const { return readout_.readout_s(); }
  double depth_delay_s() const { return depth_delay_.delay_s(); }

 private:
  using Frame = std::shared_ptr<const FrameView>;

  //   kInitializing -> kTracking           the first frame with depth, or pair of frames, starts the map
  //   kTracking -> kLost                   a frame can't be localized
  //   kLost -> kTracking                   one can, or a new part of the map starts after max_lost_us
  enum class State { kInitializing, kTracking, kLost };
  State state() const;
  bool has_map() const { return replica_.map().keyframes().size() > 0; }

  // A frame as the camera took it: row after row, and its depths at another time.
  struct CameraView {
    Frame view;
    double depth_delay_s = 0.0;  // by how much later; 0: too little to matter
    DepthSurfaces surfaces;      // if it matters
  };

  // What is remembered of the last tracked frame.
  struct Last {
    TrackedFrame frame;
    Rigid3 reference_from_camera;  // in the reference's units (Keyframe::scale)
    StepEvidence evidence = StepEvidence::kStrong;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();    // of the camera's center, in its axes and those units
    std::optional<CameraMotion> mean_motion = std::nullopt;  // since the frame before, in units of the world
    bool is_wide_step = false;                               // FoundFrame::is_wide
    std::optional<PoseInfluences> influences = std::nullopt;
    std::optional<Matrix6d> pose_covariance = std::nullopt;  // of the way from the reference to here
    int num_outliers = 0;                                    // points that were matched and contradict the pose
    bool is_doubtful = false;                                // PoseEstimate::is_step_doubtful
  };

  // When the camera was lost, if it moved steadily then: a guess at place and scale of the next part.
  struct Drift {
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // units/s, in its own axes
    int64_t utime_us = 0;
  };

  struct MotionAt {
    MotionModel model;
    int64_t utime_us = 0;
  };

  struct FramePose {
    PoseOptimizationResult optimized;
    StepEvidence evidence = StepEvidence::kStrong;
  };

  MapTrackingResult UndecidedResult(const FrameView& view) const;
  void CountPoints(PoseEstimate& pose) const;
  void DescribePose(MapTrackingResult& result);
  BodyState DescribeBody() const;
  bool Start(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  bool StartFromDepth(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  bool StartFromPair(const Frame& view, std::vector<KeyframeObservation>& keyframes);
  void UpdateLast();
  bool TakeAnswer(const RelocalizationAnswer& answer, const Frame& view);
  bool CanAskFor(const FrameView& view) const;
  ExpectedFrame Expect(const FrameView& view) const;
  FrameSearch SearchFor(const CameraView& taken) const;
  bool Localize(const CameraView& taken, FrameSearch& search);
  std::optional<CameraMotion> MeanMotionOf(const TrackedFrame& frame) const;
  std::optional<CameraMotion> MotionOf(const TrackedFrame& frame) const;
  CameraView Taken(const FeatureFrame& features) const;
  Frame AtOneTime(const CameraView& taken, const TrackedFrame& frame, const std::optional<CameraMotion>& motion) const;
  FeatureFrame Unrolled(const FeatureFrame& rolled, const TrackedFrame& frame, const CameraMotion& motion) const;
  void LearnTimes(const TrackedFrame& frame);
  Sim3 WorldFromReference() const;                // identity before there is a reference
  double SinceLast(const FrameView& view) const;  // seconds
  std::optional<MotionPrediction> PredictMotion(const FrameView& view) const;
  PosePrior PriorOf(const MotionPrediction& motion) const;
  bool IsDoubtful(const TrackedFrame& frame, const Rigid3& reference_from_camera) const;
  bool IsWayOpen(const TrackedFrame& frame, const Rigid3& reference_from_camera) const;
  MotionPrior ExpectFrom(KeyframeId reference, const Rigid3& reference_from_camera, int64_t utime_us) const;
  void ResetMotion();
  std::optional<Drift> DriftNow() const;
  void TakeOverMotion(MonoStart& start);
  std::optional<double> LengthByGround(const MonoStart& start, double interval_s);
  void WatchScale(const Rigid3& reference_from_camera);
  void WatchGround(const TrackedFrame& frame, const FramePose& pose);
  bool FollowPair(FrameSearch& search, std::vector<KeyframeObservation>& keyframes);
  FramePose OptimizeWithMotion(TrackedFrame& frame) const;
  std::optional<Matrix6d> CovarianceFromReference(const TrackedFrame& frame,
                                                  const std::optional<PoseInfluences>& influences);
  void Remember(TrackedFrame frame, const FramePose& pose, bool is_wide_step);
  bool NoteLoss(int64_t utime_us);
  bool IsKeyframeDue();
  std::optional<PoseInfluences> InfluencesOnReference(const TrackedFrame& frame, KeyframeId reference) const;
  KeyframeObservation MakeKeyframe(TrackedFrame& frame, KeyframeId reference, const Rigid3& reference_from_camera);
  void AddDepthPoints(TrackedFrame& frame, KeyframeId id, SentKeyframe& sent) const;
  void AddPairPoints(TrackedFrame& frame, KeyframeObservation& keyframe, SentKeyframe& sent) const;

  const MapTrackerOptions options_;
  MapReplica replica_;
  CameraCalibration calibration_;  // that the source's frames bring
  MonoInitializer initializer_;
  KeyframeDecision decision_;
  std::optional<Last> last_;                     // nullopt: no part of the map is followed
  MotionModel motion_;                           // in the reference's units
  std::optional<MotionAt> motion_at_reference_;  // as it was when that keyframe was made
  ReadoutEstimator readout_;
  DepthDelayEstimator depth_delay_;
  std::optional<CameraMotion> camera_motion_;  // of the last frame, while it was read; in units of the world
  std::optional<CameraMotion> camera_motion_at_reference_;  // likewise
  KeyframeId next_keyframe_{0};
  KeyframeId reference_;
  double reference_scale_ = 1.0;  // of its units, when the last frame was tracked or the map changed
  // By point: its own, or those of the first frame tracked from it.
  std::optional<PoseInfluences> reference_influences_;
  WayCorrections way_corrections_;
  std::optional<TrackedFrame> reference_frame_;  // as it was when it became a keyframe; nullopt: it is the map's alone
  Rigid3 world_from_start_;                      // camera where the next part of the map begins
  std::optional<Drift> drift_;                   // of the last loss
  ScaleWatch scale_;                             // mono
  GroundWatch ground_;                           // mono; in units of the world
  int64_t previous_utime_us_ = 0;                // of the frame before
  std::optional<int64_t> tracked_utime_us_;      // of the last frame with a pose
  std::optional<int64_t> lost_since_us_;
  Frame asked_;  // the frame that asked last
};

}  // namespace tessera
