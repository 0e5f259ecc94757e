#include "tracking/map_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <stdexcept>
#include <utility>

#include "geometry/absolute_pose.h"
#include "matching/frame_pose.h"
#include "measurement/landmark_description.h"
#include "tracking/local_points.h"
#include "tracking/pair_motion.h"
#include "tracking/pair_points.h"

namespace tessera {
namespace {

// Of the points that agree on a pose by themselves: fewer that agree with the motion of a moment ago contradict it.
constexpr double kMinShareWithMotion = 0.5;
constexpr double kDriftInterval_s = 0.1;
// A try to follow the last frame has found the true pose if these shares of the matches, and of the last frame's
// points, agree with it. At usual steps 0.77 and 0.44 is the least that was seen (KITTI 03); walls and fences seen one
// window too far gave up to 0.66 and 0.37.
constexpr double kMinShareOfMatches = 0.5, kMinShareOfLast = 0.4;
// Or if a steady motion knew, to this standard deviation, where points are seen, and the camera turned as predicted. In
// the open, where points fade from frame to frame, no other try is better.
constexpr double kMaxPredictionSigma_px = 2.0, kMaxTurnFromPrediction_rad = 0.01;
constexpr double kMinCoverage = 0.4;     // see Coverage(): of a pose that no try has found clearly
constexpr int kMaxSharedAtPair = 100;    // with fewer known points, a wide pair's points go to the mapper as well
constexpr double kPairSigmaShare = 0.2;  // of a step that two frames by themselves have shown
// Of two frames, for their poses to tell how the camera moved while an image was read.
constexpr double kMaxFrameInterval_s = 0.07;

// A point as one view alone knows it, in the frame of its camera. `covariance`: of the point, if its depth isn't known
// by the view itself.
Landmark PointOf(const FrameView& view, int32_t keypoint, const Eigen::Vector3d& point_in_camera,
                 const Eigen::Matrix3d* covariance = nullptr) {
  Landmark point = DescribeInCamera(view.features(), keypoint, point_in_camera);
  const double information = covariance != nullptr
                                 ? 1.0 / point.normal.dot(*covariance * point.normal)
                                 : DepthInformation(view.features(), keypoint, Rigid3::Identity(), point);
  point.depth_sigma = DepthSigma(information, point_in_camera.norm());
  return point;
}

double DepthIn(const TrackedFrame& frame, const SeenPoint& point) {
  return (frame.world_from_camera.Inverse() * point.landmark.position_in_world).z();
}

// Of the points that it sees; 0: none.
double MedianDepth(const TrackedFrame& frame) {
  std::vector<double> depths;
  for (const SeenPoint& point : frame.points) {
    if (point.valid()) depths.push_back(DepthIn(frame, point));
  }
  if (depths.empty()) return 0.0;
  const auto middle = depths.begin() + static_cast<ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace

Result<> MapTrackerOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(start.Check());
  TESSERA_RETURN_IF_FAILED(matching.Check());
  TESSERA_RETURN_IF_FAILED(keyframes.Check());
  TESSERA_RETURN_IF_FAILED(Require(max_unanswered_keyframes >= 2, "max_unanswered_keyframes must be at least 2"));
  TESSERA_RETURN_IF_FAILED(Require(min_inliers >= 6, "min_inliers must be at least 6"));
  return Require(max_local_keyframes >= 1, "max_local_keyframes must be at least 1");
}

MapTracker::MapTracker(const MapTrackerOptions& options)
    : options_(options), initializer_(options.start), decision_(options.keyframes) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
}

Result<> MapTracker::ApplyDelta(const MapDelta& delta) {
  // Keyframes of a map that was loaded have numbers too.
  if (delta.is_snapshot) next_keyframe_.value = std::max(next_keyframe_.value, delta.answers.value + 1);
  return replica_.Apply(delta);
}

MapTrackingResult MapTracker::Track(const FeatureFrame& features, const RelocalizationAnswer* answer, bool may_ask) {
  const auto view = std::make_shared<const FrameView>(features);
  const State before = state();
  MapTrackingResult result = UndecidedResult(*view);
  if (last_) UpdateLast();
  const bool is_answered = answer != nullptr && TakeAnswer(*answer, view);
  if (is_answered) result.pose.relocalized_by = answer->frame;
  // The answer may be for this frame, which it has localized then, or for one before, which this one follows.
  const bool is_localized = is_answered && answer->frame == features.frame;

  if (is_localized || (last_ && Localize(view))) {
    result.pose.num_matches = last_->frame.NumPoints();
    result.pose.is_relocalized = before == State::kLost || is_answered;
    result.pose.state = TrackingState::kTracked;
    if (options_.makes_keyframes && IsKeyframeDue()) {
      if (view->baseline_m() == 0.0) AddScaleDrift(last_->reference_from_camera);
      result.keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
    }
  } else if (before == State::kTracking && FollowPair(view, result.keyframes)) {
    result.pose.num_matches = last_->frame.NumPoints();
    result.pose.state = TrackingState::kTracked;
  } else if (may_ask && CanAskFor(*view)) {
    asked_ = view;
    result.asks_relocalization = true;
    return result;
  } else if (before == State::kInitializing) {
    result.pose.state = Start(view, result.keyframes) ? TrackingState::kTracked : TrackingState::kInitializing;
  } else {
    const bool has_started = NoteLoss(features.utime_us) && Start(view, result.keyframes);
    result.pose.state = has_started ? TrackingState::kTracked : TrackingState::kLost;
  }
  if (result.pose.state == TrackingState::kTracked) DescribePose(result);
  previous_utime_us_ = features.utime_us;
  return result;
}

MapTracker::State MapTracker::state() const {
  if (!last_ && !has_map()) return State::kInitializing;
  return lost_since_us_ || !last_ ? State::kLost : State::kTracking;
}

MapTrackingResult MapTracker::UndecidedResult(const FrameView& view) const {
  MapTrackingResult result;
  result.pose.frame = view.features().frame;
  result.pose.utime_us = view.features().utime_us;
  result.pose.arrival_us = view.features().arrival_us;
  result.pose.num_features = view.size();
  result.pose.num_landmarks = static_cast<int32_t>(replica_.map().landmarks().size());
  return result;
}

bool MapTracker::CanAskFor(const FrameView& view) const {
  return has_map() && view.size() >= options_.min_relocalized_inliers;
}

// The frame was tracked, and is now the last one.
void MapTracker::DescribePose(MapTrackingResult& result) {
  lost_since_us_.reset();
  result.pose.world_from_camera = last_->frame.world_from_camera;
  result.pose.reference_keyframe = reference_;
  result.pose.reference_from_camera = last_->reference_from_camera;
  result.pose.num_inliers = last_->frame.NumPoints();
  result.pose.is_keyframe = !result.keyframes.empty();
  result.pose.is_step_doubtful = last_->evidence == StepEvidence::kContradictory;
}

bool MapTracker::Start(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  ResetMotion();
  return view->baseline_m() > 0.0 ? StartFromDepth(view, keyframes) : StartFromPair(view, keyframes);
}

bool MapTracker::StartFromDepth(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  int num_points = 0;
  for (int i = 0; i < view->size(); ++i) num_points += view->observation(i).has_right() ? 1 : 0;
  if (num_points < options_.min_start_points) return false;
  TrackedFrame frame(view);
  frame.world_from_camera = world_from_start_;
  last_.emplace(Last{std::move(frame), Rigid3::Identity()});
  keyframes.push_back(MakeKeyframe(last_->frame, {}, world_from_start_));
  return true;
}

// Both frames become keyframes; the points go with the second one, as seen by a keypoint of each.
bool MapTracker::StartFromPair(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  std::optional<MonoStart> start = initializer_.Add(view);
  if (!start) return false;
  initializer_ = MonoInitializer(options_.start);
  scale_variance_ = 0.0;
  TakeOverMotion(*start);
  const KeyframeId first_id = next_keyframe_;
  TrackedFrame first(start->first), second(start->second);
  first.world_from_camera = world_from_start_;
  keyframes.push_back(MakeKeyframe(first, {}, world_from_start_));

  const Rigid3 first_from_second = start->second_from_first.Inverse();
  second.world_from_camera = world_from_start_ * first_from_second;
  SentKeyframe sent{{}, world_from_start_, {}};
  for (const MonoStart::Point& point : start->points) {
    const Landmark in_camera =
        PointOf(*start->first, point.keypoint_first, point.point.point_in_world, &point.point.covariance);
    sent.points[point.keypoint_first] = in_camera;
    second.points[Index(point.keypoint_second)] = {{{}, first_id, point.keypoint_first},
                                                   InWorld(Sim3::From(world_from_start_), in_camera)};
  }
  replica_.Send(first_id, std::move(sent));
  last_.emplace(Last{std::move(second), Rigid3::Identity()});
  keyframes.push_back(MakeKeyframe(last_->frame, first_id, first_from_second));
  return true;
}

// Two views don't know how far apart they are: as far as the camera goes in that time, if it still moves as it did when
// it was lost, and on its way from there. That is a guess until a loop joins the parts.
void MapTracker::TakeOverMotion(MonoStart& start) {
  if (!drift_) return;
  const int64_t first_us = start.first->features().utime_us, second_us = start.second->features().utime_us;
  const double interval_s = 1e-6 * static_cast<double>(second_us - first_us);
  const double scale = drift_->velocity.norm() * interval_s / start.second_from_first.translation.norm();
  start.second_from_first.translation *= scale;
  for (MonoStart::Point& point : start.points) {
    point.point.point_in_world *= scale;
    point.point.covariance *= scale * scale;
  }
  const double lost_s = 1e-6 * static_cast<double>(first_us - drift_->utime_us);
  world_from_start_ = world_from_start_ * Rigid3{Eigen::Quaterniond::Identity(), drift_->velocity * lost_s};
  drift_.reset();
}

// The map may have changed: the last frame keeps its pose relative to its reference, and its points move with the map.
void MapTracker::UpdateLast() {
  decision_.Renew(replica_);
  if (const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(reference_)) {
    last_->frame.world_from_camera = (*world_from_reference * last_->reference_from_camera).Pose();
  }
  for (SeenPoint& point : last_->frame.points) {
    if (!point.valid()) continue;
    point.id = replica_.Renew(point.id);
    if (const std::optional<Landmark> landmark = replica_.Find(point.id)) {
      point.landmark = *landmark;
    } else {
      point = {};
    }
  }
}

// The frame becomes the last one if its pose can be found in the map around that one.
bool MapTracker::Localize(const Frame& view) {
  TrackedFrame frame(view);
  frame.view = Unrolled(view, frame, last_->mean_motion);
  std::optional<StepKind> step;
  if (!lost_since_us_) step = FollowLast(frame);
  if (!step) {
    if (!Relocalize(frame)) return false;
    step = StepKind::kDoubtful;
  }
  frame.view = Unrolled(view, frame, MotionOf(frame));
  const KnownPoints around = PointsAround(frame);
  MatchLocal(around, options_.matching.local_radius_px, options_.matching, frame);
  const int min_of_last = static_cast<int>(options_.min_share_of_last * last_->frame.NumPoints());
  const int min_inliers =
      lost_since_us_ ? options_.min_relocalized_inliers : std::max(options_.min_inliers, min_of_last);
  const FramePose pose = OptimizeWithMotion(frame);
  if (pose.optimized.num_inliers < min_inliers) return false;
  // After a loss the greater number of inliers says as much.
  if (!lost_since_us_ && step == StepKind::kDoubtful && Coverage(around, frame) < kMinCoverage) return false;
  Remember(std::move(frame), pose, *step);
  return true;
}

// How the camera moved from the last frame to this one; nullopt where that says nothing about the time of a readout.
std::optional<CameraMotion> MapTracker::MeanMotionOf(const TrackedFrame& frame) const {
  const double interval_s = SinceLast(*frame.view);
  if (lost_since_us_ || interval_s <= 0.0 || interval_s > kMaxFrameInterval_s) return std::nullopt;
  return MotionOver(last_->frame.world_from_camera.Inverse() * frame.world_from_camera, interval_s);
}

// While the frame was read: the mean motion is that of half an interval ago.
std::optional<CameraMotion> MapTracker::MotionOf(const TrackedFrame& frame) const {
  std::optional<CameraMotion> motion = MeanMotionOf(frame);
  if (!motion || !last_->mean_motion) return motion;
  motion->velocity += 0.5 * (motion->velocity - last_->mean_motion->velocity);
  motion->turn_rate += 0.5 * (motion->turn_rate - last_->mean_motion->turn_rate);
  return motion;
}

// As the keypoints would be seen if all rows were read at once, with the depths of the points that `frame` sees.
MapTracker::Frame MapTracker::Unrolled(const Frame& rolled, const TrackedFrame& frame,
                                       const std::optional<CameraMotion>& motion) const {
  if (readout_.readout_s() == 0.0 || !motion) return rolled;
  const double usual_depth = MedianDepth(last_->frame);
  std::vector<double> depths(frame.points.size(), usual_depth);
  for (size_t i = 0; i < depths.size(); ++i) {
    const double measured_m = static_cast<double>(rolled->keypoint(static_cast<int>(i)).depth_m);
    if (frame.points[i].valid()) {
      depths[i] = DepthIn(frame, frame.points[i]);
    } else if (measured_m > 0.0) {
      depths[i] = measured_m;
    }
  }
  return std::make_shared<const FrameView>(Unroll(rolled->features(), depths, readout_.readout_s(), *motion));
}

std::optional<MotionPrediction> MapTracker::PredictMotion(const FrameView& view) const {
  const double interval_s = SinceLast(view);
  return interval_s > 0.0 ? motion_.Predict(interval_s) : std::nullopt;
}

double MapTracker::SinceLast(const FrameView& view) const {
  return 1e-6 * static_cast<double>(view.features().utime_us - last_->frame.view->features().utime_us);
}

Sim3 MapTracker::WorldFromReference() const { return replica_.WorldFromKeyframe(reference_).value_or(Sim3{}); }

// Where the motion of a moment ago takes the camera; nullopt: nothing that could be held against images.
std::optional<PosePrior> MapTracker::PriorOf(const MotionPrediction& motion) const {
  if (!motion.is_steady) return std::nullopt;
  const Sim3 world_from_reference = WorldFromReference();
  const double area = world_from_reference.scale * world_from_reference.scale;
  const Rigid3 reference_from_expected = last_->reference_from_camera * motion.last_from_current;
  return PosePrior{(world_from_reference * reference_from_expected).Pose().Inverse(),
                   (motion.covariance * area).inverse()};
}

// By the images alone where they fix how far the camera went, else carried by how it moved a moment ago. Which points
// are outliers is told with the motion: wrong matches that agree on another one can't win.
MapTracker::FramePose MapTracker::OptimizeWithMotion(TrackedFrame& frame) const {
  const std::optional<MotionPrediction> motion = lost_since_us_ ? std::nullopt : PredictMotion(*frame.view);
  const std::optional<PosePrior> prior = motion ? PriorOf(*motion) : std::nullopt;
  if (!prior) return {OptimizeFramePose(options_.pose, nullptr, frame), StepEvidence::kStrong};
  TrackedFrame carried = frame;
  const PoseOptimizationResult with_motion = OptimizeFramePose(options_.pose, &*prior, carried);
  TrackedFrame seen = carried;
  PoseOptimizationResult by_images = OptimizeFramePose(options_.pose, nullptr, seen);
  // Unless most points contradict the motion: the camera may have been carried away. That is told, not overruled.
  if (by_images.num_inliers < kMinShareWithMotion * frame.NumPoints()) {
    TrackedFrame alone = frame;
    const PoseOptimizationResult by_all = OptimizeFramePose(options_.pose, nullptr, alone);
    if (by_images.num_inliers < kMinShareWithMotion * by_all.num_inliers) {
      by_images = by_all;
      seen = std::move(alone);
    }
  }
  const Sim3 world_from_reference = WorldFromReference();
  const double area = world_from_reference.scale * world_from_reference.scale;
  const Rigid3 reference_from_camera = (world_from_reference.Inverse() * seen.world_from_camera).Pose();
  const StepEvidence evidence = Judge(*motion, last_->reference_from_camera.Inverse() * reference_from_camera,
                                      TranslationCovariance(by_images.information) / area);
  const bool is_carried = evidence == StepEvidence::kWeak;
  frame = std::move(is_carried ? carried : seen);
  return {is_carried ? with_motion : by_images, evidence};
}

KnownPoints MapTracker::PointsAround(const TrackedFrame& frame) const {
  return LocalPoints(replica_, frame, options_.max_local_keyframes);
}

// In windows around where the motion leads, ever wider; then from where the points around the last frame are found by
// descriptor alone, and from how the two frames as such show the motion. The first clear try ends it, else the best one
// counts, if any has enough inliers.
std::optional<MapTracker::StepKind> MapTracker::FollowLast(TrackedFrame& frame) const {
  const Frame view = frame.view;
  const std::optional<MotionPrediction> motion = PredictMotion(*view);
  const Rigid3 last_from_current = motion ? motion->last_from_current : Rigid3::Identity();
  const Rigid3 reference_from_current = last_->reference_from_camera * last_from_current;
  const Rigid3 predicted = (WorldFromReference() * reference_from_current).Pose();
  const std::optional<PosePrior> prior = motion ? PriorOf(*motion) : std::nullopt;
  FollowTries tries;
  bool is_clear = false;
  for (const double widening : {1.0, 2.0, 4.0}) {
    is_clear = is_clear || TryAt(predicted, widening, prior ? &*prior : nullptr, view, tries);
  }
  if (!is_clear) {
    TrackedFrame placed(view);
    is_clear = Relocalize(placed) && TryAt(placed.world_from_camera, 1.0, nullptr, view, tries);
  }
  if (!is_clear) {
    const std::optional<Rigid3> by_pair = PoseByPair(*view);
    is_clear = by_pair && TryAt(*by_pair, 1.0, nullptr, view, tries);
  }
  if (tries.num_inliers < options_.min_last_matches / 2) return std::nullopt;
  frame = std::move(*tries.best);
  if (!is_clear) return StepKind::kDoubtful;
  return tries.num_tries == 1 ? StepKind::kUsual : StepKind::kWide;
}

// How well a prior knows where the last frame's points are seen, by its translation; pixels.
double MapTracker::SigmaInImage(const PosePrior& prior) const {
  const double sigma = std::sqrt(prior.information.inverse().trace() / 3.0);
  return last_->frame.view->calibration().fx_px * sigma / MedianDepth(last_->frame);
}

// Whether the last frame's points, looked for around where they should be at this pose, show clearly what it is.
bool MapTracker::TryAt(const Rigid3& world_from_camera, double widening, const PosePrior* prior, const Frame& view,
                       FollowTries& tries) const {
  ++tries.num_tries;
  TrackedFrame frame(view);
  frame.world_from_camera = world_from_camera;
  const int num = MatchLast(last_->frame, widening * options_.matching.last_radius_px, options_.matching, frame);
  if (num < options_.min_last_matches) return false;
  const int num_inliers = OptimizeFramePose(options_.pose, prior, frame).num_inliers;
  const double turn_rad = LogSO3(world_from_camera.rotation.conjugate() * frame.world_from_camera.rotation).norm();
  if (num_inliers > tries.num_inliers) {
    tries.num_inliers = num_inliers;
    tries.best = std::move(frame);
  }
  if (num_inliers < options_.min_last_matches / 2) return false;
  if (num_inliers > kMinShareOfMatches * num && num_inliers > kMinShareOfLast * last_->frame.NumPoints()) return true;
  return prior != nullptr && turn_rad < kMaxTurnFromPrediction_rad && SigmaInImage(*prior) < kMaxPredictionSigma_px;
}

// Mono: where the last frame and this one by themselves show the camera.
std::optional<Rigid3> MapTracker::PoseByPair(const FrameView& view) const {
  if (view.baseline_m() > 0.0) return std::nullopt;
  const std::optional<MotionPrediction> motion = PredictMotion(view);
  std::optional<Eigen::Vector3d> expected;
  if (motion) expected = WorldFromReference().scale * motion->last_from_current.translation;
  const std::optional<Rigid3> last_from_current = EstimatePairMotion(last_->frame, view, expected, {});
  return last_from_current ? std::optional(last_->frame.world_from_camera * *last_from_current) : std::nullopt;
}

// Where hardly a known point is left in view, the way on is what the last frame and this one show by themselves: both
// become keyframes, and what they see is new.
bool MapTracker::FollowPair(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  if (!last_ || !options_.makes_keyframes) return false;
  const std::optional<Rigid3> world_from_camera = PoseByPair(*view);
  if (!world_from_camera) return false;
  const double interval_s = SinceLast(*view);
  if (!reference_frame_ || reference_frame_->view != last_->frame.view) {
    keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
  }
  TrackedFrame frame(view);
  frame.world_from_camera = *world_from_camera;
  MatchLast(last_->frame, options_.matching.last_radius_px, options_.matching, frame);
  OptimizeFrame(options_.pose, frame);  // leaves the points that agree with one another
  frame.world_from_camera = *world_from_camera;
  const Rigid3 reference_from_camera = (WorldFromReference().Inverse() * frame.world_from_camera).Pose();
  const double sigma = kPairSigmaShare * reference_from_camera.translation.norm();
  const Eigen::Matrix3d covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  if (interval_s > 0.0) motion_.Add(reference_from_camera, covariance, interval_s, true);
  last_.emplace(Last{std::move(frame), reference_from_camera, StepEvidence::kWeak, covariance, std::nullopt,
                     StepKind::kDoubtful});
  AddScaleDrift(reference_from_camera);
  keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
  return true;
}

// Without a predicted pose: the points around the last frame, matched by descriptor alone.
bool MapTracker::Relocalize(TrackedFrame& frame) const {
  KnownPoints points = PointsAround(last_->frame);
  for (const SeenPoint& point : last_->frame.points) {
    if (point.valid()) points.emplace_back(point.id, point.landmark);
  }
  MatchAnywhere(points, options_.matching, frame);
  std::vector<PointPixel> pairs;
  for (int i = 0; i < frame.view->size(); ++i) {
    if (!frame.points[Index(i)].valid()) continue;
    const PixelObservation seen = frame.view->observation(i);
    pairs.push_back({frame.points[Index(i)].landmark.position_in_world, seen.pixel_px, seen.sigma_px});
  }
  const auto seed = static_cast<uint64_t>(frame.view->features().frame.value);
  const auto pose = EstimateAbsolutePose(frame.view->calibration(), pairs, seed, {});
  if (!pose) return false;
  frame.world_from_camera = pose->camera_from_world.Inverse();
  return OptimizeFrame(options_.pose, frame) >= options_.min_last_matches / 2;
}

// The frame that asked, this one or one before, becomes the last that was tracked. False if the answer does not hold in
// this map.
bool MapTracker::TakeAnswer(const RelocalizationAnswer& answer, const Frame& view) {
  const Frame asked = view->features().frame == answer.frame ? view : asked_;
  const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(answer.reference);
  if (!world_from_reference || asked == nullptr || asked->features().frame != answer.frame) return false;
  TrackedFrame frame(asked);
  frame.world_from_camera = (*world_from_reference * answer.reference_from_camera).Pose();
  for (const SeenLandmark& seen : answer.seen) {
    const Landmark* landmark = replica_.map().FindLandmark(seen.landmark);
    if (landmark != nullptr && seen.keypoint < frame.view->size()) {
      frame.points[Index(seen.keypoint)] = {{seen.landmark, {}, -1}, *landmark};
    }
  }
  if (OptimizeFrame(options_.pose, frame) < options_.min_relocalized_inliers / 2) return false;
  MatchLocal(PointsAround(frame), options_.matching.local_radius_px, options_.matching, frame);
  if (OptimizeFrame(options_.pose, frame) < options_.min_relocalized_inliers) return false;
  reference_ = answer.reference;
  reference_frame_.reset();
  decision_.Restart(frame);
  const Rigid3 reference_from_camera = (world_from_reference->Inverse() * frame.world_from_camera).Pose();
  ResetMotion();
  last_.emplace(Last{std::move(frame), reference_from_camera});
  return true;
}

void MapTracker::Remember(TrackedFrame frame, const FramePose& pose, StepKind step) {
  const Sim3 reference_from_world = WorldFromReference().Inverse();
  const Rigid3 reference_from_camera = (reference_from_world * frame.world_from_camera).Pose();
  const double interval_s = SinceLast(*frame.view);
  // After a step that contradicts it, nothing is known of how the camera moves: it may have been carried away.
  const Eigen::Matrix3d covariance =
      TranslationCovariance(pose.optimized.information) * reference_from_world.scale * reference_from_world.scale;
  if (lost_since_us_ || interval_s <= 0.0 || pose.evidence == StepEvidence::kContradictory) {
    ResetMotion();
  } else {
    motion_.Add(last_->reference_from_camera.Inverse() * reference_from_camera, covariance, interval_s,
                pose.evidence == StepEvidence::kWeak);
  }
  camera_motion_ = MotionOf(frame);
  const std::optional<CameraMotion> mean_motion = MeanMotionOf(frame);
  LearnReadout(frame);
  lost_since_us_.reset();
  last_.emplace(Last{std::move(frame), reference_from_camera, pose.evidence, covariance, mean_motion, step});
}

void MapTracker::LearnReadout(const TrackedFrame& frame) {
  const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(reference_);
  if (!camera_motion_ || !camera_motion_at_reference_ || !world_from_reference) return;
  readout_.Add(frame, *camera_motion_, {world_from_reference->Pose(), *camera_motion_at_reference_});
}

void MapTracker::AddScaleDrift(const Rigid3& reference_from_camera) {
  const Eigen::Vector3d step = reference_from_camera.rotation.inverse() * reference_from_camera.translation;
  const double squared = step.squaredNorm();
  const double variance = step.dot(last_->covariance * step) / (squared * squared);  // of the logarithm of its length
  if (variance > 0.0 && std::isfinite(variance)) scale_variance_ += variance;
}

void MapTracker::ResetMotion() {
  motion_.Reset();
  motion_at_reference_.reset();
  camera_motion_.reset();
  camera_motion_at_reference_.reset();
}

// Of the last frame that was tracked; nullopt: it did not move steadily.
std::optional<MapTracker::Drift> MapTracker::DriftNow() const {
  const Sim3 world_from_reference = WorldFromReference();
  const auto motion = motion_.Predict(kDriftInterval_s, Eigen::Quaterniond::Identity());
  if (!motion || !motion->is_steady) return std::nullopt;
  return Drift{world_from_reference.scale * motion->last_from_current.translation / kDriftInterval_s,
               last_->frame.view->features().utime_us};
}

// Whether the loss has lasted so long that a new part of the map should begin.
bool MapTracker::NoteLoss(int64_t utime_us) {
  if (!lost_since_us_) lost_since_us_ = utime_us;
  if (utime_us - *lost_since_us_ <= options_.max_lost_us || !options_.makes_keyframes) return false;
  if (last_) {
    world_from_start_ = last_->frame.world_from_camera;
    drift_ = DriftNow();
    last_.reset();
    initializer_ = MonoInitializer(options_.start);
  }
  return true;
}

bool MapTracker::IsKeyframeDue() {
  const TrackedFrame& frame = last_->frame;
  const double near_m = options_.max_depth_baselines * frame.view->baseline_m();
  KeyframeDecision::NearKeypoints near;
  for (int i = 0; near_m > 0.0 && i < frame.view->size(); ++i) {
    const auto point = PointFromDepth(frame.view->features(), i);
    if (!point || point->z() > near_m) continue;
    (frame.points[Index(i)].valid() ? near.num_known : near.num_new) += 1;
  }
  const Rigid3 world_from_reference = WorldFromReference().Pose();
  const int64_t interval_us = frame.view->features().utime_us - previous_utime_us_;
  const bool is_due = decision_.Decide(frame, interval_us, world_from_reference, near);
  return is_due && static_cast<int>(replica_.sent().size()) < options_.max_unanswered_keyframes;
}

// Where a camera that turned so since `reference` was made should be by how it moved then.
MotionPrior MapTracker::ExpectFrom(KeyframeId reference, const Rigid3& reference_from_camera, int64_t utime_us) const {
  if (!motion_at_reference_ || reference != reference_ || utime_us <= motion_at_reference_->utime_us) return {};
  const double interval_s = 1e-6 * static_cast<double>(utime_us - motion_at_reference_->utime_us);
  const auto motion = motion_at_reference_->model.Predict(interval_s, reference_from_camera.rotation);
  if (!motion || !motion->is_steady) return {};
  const Eigen::Matrix3d information = motion->covariance.inverse();
  return {motion->last_from_current.translation, 0.5 * (information + information.transpose())};
}

// The frame becomes the reference of those to come.
KeyframeObservation MapTracker::MakeKeyframe(TrackedFrame& frame, KeyframeId reference,
                                             const Rigid3& reference_from_camera) {
  KeyframeObservation keyframe;
  keyframe.id = next_keyframe_;
  keyframe.features = frame.view->features();
  keyframe.world_from_camera = frame.world_from_camera;
  keyframe.reference = reference;
  keyframe.reference_from_camera = reference_from_camera;
  keyframe.expected = ExpectFrom(reference, reference_from_camera, keyframe.features.utime_us);
  motion_at_reference_ = MotionAt{motion_, keyframe.features.utime_us};
  keyframe.landmarks.resize(frame.points.size());
  for (size_t i = 0; i < frame.points.size(); ++i) {
    const SeenPoint& point = frame.points[i];
    keyframe.landmarks[i] = point.id.landmark;
    if (point.id.keyframe.valid()) {
      const Sim3 other_from_world = replica_.WorldFromKeyframe(point.id.keyframe).value_or(Sim3{}).Inverse();
      keyframe.shared.push_back({static_cast<int32_t>(i), point.id.keyframe, point.id.keypoint,
                                 other_from_world * point.landmark.position_in_world});
    }
  }
  SentKeyframe sent{reference, reference_from_camera, {}};
  // Points that one view alone knows are no measure of what should be seen again, unless there are no others.
  const bool has_known_points = frame.NumPoints() > 0;
  if (has_known_points) decision_.Restart(frame);
  AddDepthPoints(frame, keyframe.id, sent);
  AddPairPoints(frame, keyframe, sent);
  if (!has_known_points) decision_.Restart(frame);
  replica_.Send(keyframe.id, std::move(sent));
  reference_ = keyframe.id;
  reference_frame_ = frame;
  camera_motion_at_reference_ = camera_motion_;
  ++next_keyframe_.value;
  if (last_) last_->reference_from_camera = Rigid3::Identity();
  return keyframe;
}

// Until the mapper answers, near keypoints with depth are points of their own.
void MapTracker::AddDepthPoints(TrackedFrame& frame, KeyframeId id, SentKeyframe& sent) const {
  const double max_depth_m = options_.max_depth_baselines * frame.view->baseline_m();
  for (int i = 0; i < frame.view->size(); ++i) {
    if (frame.points[Index(i)].valid()) continue;
    const auto point = PointFromDepth(frame.view->features(), i);
    if (!point || point->z() > max_depth_m) continue;
    const Landmark in_camera = PointOf(*frame.view, i, *point);
    sent.points[i] = in_camera;
    frame.points[Index(i)] = {{{}, id, i}, InWorld(Sim3::From(frame.world_from_camera), in_camera)};
  }
}

// Mono, after a wide step: until the mapper answers, what this keyframe and its reference see is known by them. At the
// next step it may be all that is left in view.
void MapTracker::AddPairPoints(TrackedFrame& frame, KeyframeObservation& keyframe, SentKeyframe& sent) const {
  const bool is_wide = last_ && &last_->frame == &frame && last_->step != StepKind::kUsual;
  if (!is_wide || frame.view->baseline_m() > 0.0 || !reference_frame_ || sent.reference != reference_) return;
  const Sim3 world_from_reference = WorldFromReference();
  TrackedFrame other = *reference_frame_;
  other.world_from_camera = world_from_reference.Pose();
  const bool shares = frame.NumPoints() < kMaxSharedAtPair;
  const Sim3 units = Sim3::From({}, 1.0 / world_from_reference.scale);
  for (const PairPoint& point : FindPairPoints(frame, other)) {
    const Landmark in_world = InWorld(Sim3::From(frame.world_from_camera), point.in_camera);
    sent.points[point.keypoint] = InWorld(units, point.in_camera);
    frame.points[Index(point.keypoint)] = {{{}, keyframe.id, point.keypoint}, in_world};
    if (!shares) continue;
    keyframe.shared.push_back({point.keypoint, sent.reference, point.other_keypoint,
                               world_from_reference.Inverse() * in_world.position_in_world});
  }
}

}  // namespace tessera
