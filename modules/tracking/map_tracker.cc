#include "tracking/map_tracker.h"

#include <algorithm>
#include <array>
#include <span>
#include <stdexcept>
#include <utility>

#include "matching/frame_pose.h"
#include "measurement/landmark_description.h"
#include "tracking/confirmed_points.h"
#include "tracking/keyframe_making.h"
#include "tracking/local_points.h"
#include "tracking/pose_covariance.h"

namespace tessera {
namespace {

constexpr double kMinCoverage = 0.4;            // see Coverage(): of a pose that no try has found clearly
constexpr double kLongLost_s = 2.0;             // since the last pose: the camera may be where nothing is known of
constexpr double kMaxSigmas = 5.0;              // an axis, of a motion that goes on
constexpr double kMaxAcceleration_mps2 = 50.0;  // of any camera
constexpr double kOnItsWay_s = 1.0;             // since the last pose: it moves as it did
constexpr int64_t kMaxKept_us = 500'000;        // a pose, while images repeat
constexpr double kMaxStanding_px = 3.0;         // in kDriftInterval_s, as noise has it
constexpr double kExact = 1e12;                 // information about a pose that is taken as it is
constexpr double kMinJump_px = 10.0;            // in the image
constexpr int kFewInliers = 100;                // that agree with a pose: what two frames as such show counts more
constexpr double kDriftInterval_s = 0.1;
constexpr int kNewsOfBody = 10;          // pieces of the image: the mapper is to hear of it now
constexpr double kPairSigmaShare = 0.2;  // of a step that two frames by themselves have shown
// What a camera that stood goes until the next frame, in the image: a standard deviation.
constexpr double kStart_px = 1.0;

// The share of the image's cells that hold a keypoint whose point agrees with the pose.
double CellCoverage(const TrackedFrame& frame) {
  std::array<bool, kCoverageColumns * kCoverageRows> is_covered{};
  const CameraCalibration& camera = frame.view->features().calibration;
  for (size_t i = 0; i < frame.points.size(); ++i) {
    if (!frame.points[i].valid()) continue;
    const Keypoint& keypoint = frame.view->features().keypoints[i];
    const auto cell = [](float at_px, int size_px, int num) {
      return std::clamp(static_cast<int>(at_px * static_cast<float>(num) / static_cast<float>(size_px)), 0, num - 1);
    };
    const int row = cell(keypoint.y_px, camera.height_px, kCoverageRows);
    is_covered[Index(kCoverageColumns * row + cell(keypoint.x_px, camera.width_px, kCoverageColumns))] = true;
  }
  return static_cast<double>(std::ranges::count(is_covered, true)) / static_cast<double>(is_covered.size());
}

// Of the points with depth that the frame sees, the share that this keyframe saw, or one before it.
double ShareKnownAt(const Map& map, KeyframeId keyframe, const TrackedFrame& frame) {
  int num = 0, num_known = 0;
  for (const SeenPoint& point : frame.points) {
    if (!point.valid() || !HasDepth(point.landmark, frame.world_from_camera.translation)) continue;
    ++num;
    const std::span<const Observation> observations = map.ObservationsOf(point.id.landmark);
    num_known += !observations.empty() && observations.front().keyframe <= keyframe ? 1 : 0;
  }
  return num > 0 ? static_cast<double>(num_known) / num : 0.0;
}

}  // namespace

Result<> MapTrackerOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(start.Check());
  TESSERA_RETURN_IF_FAILED(search.Check());
  TESSERA_RETURN_IF_FAILED(keyframes.Check());
  TESSERA_RETURN_IF_FAILED(Require(max_unanswered_keyframes >= 2, "max_unanswered_keyframes must be at least 2"));
  TESSERA_RETURN_IF_FAILED(depth.Check());
  return Require(min_inliers >= 6, "min_inliers must be at least 6");
}

MapTracker::MapTracker(const MapTrackerOptions& options)
    : options_(options), start_(options.start), decision_(options.keyframes) {
  ThrowIfFailed<std::invalid_argument>(options.Check());
}

Result<> MapTracker::ApplyDelta(const MapDelta& delta) {
  // Keyframes of a map that was loaded have numbers too.
  if (delta.is_snapshot) next_keyframe_.value = std::max(next_keyframe_.value, delta.answers.value + 1);
  Result<> applied = replica_.Apply(delta);
  way_corrections_.Update(replica_);
  return applied;
}

MapTrackingResult MapTracker::Track(const FeatureFrame& features, const RelocalizationAnswer* answer, bool may_ask) {
  const bool is_repeated = repeated_.Contains(features);
  if (is_repeated && answer == nullptr && MayKeepPose(features.utime_us)) return KeepPose(features);
  Watch(features);
  const CapturedFrame captured =
      times_.Captured(moving_things_.Without(own_body_.Without(features)), replica_.map().lens());
  const Frame& view = captured.view;
  calibration_ = features.calibration;
  const State before = state();
  MapTrackingResult result = UndecidedResult(view->features(), view->size());
  if (last_) UpdateLast();
  const bool is_answered = answer != nullptr && TakeAnswer(*answer, view);
  if (is_answered) result.pose.relocalized_by = answer->frame;
  // The answer may be for this frame, which it has localized then, or for one before, which this one follows.
  const bool is_localized = is_answered && answer->frame == features.frame;

  std::optional<FrameSearch> search;
  if (last_ && !is_localized) {
    search.emplace(times_.AtOneTime(captured, last_->frame), last_->frame, Expect(*view), replica_, options_.search,
                   scene_.is_hidden());
  }
  if (is_localized || (search && Localize(captured, *search))) {
    CountPoints(result.pose);
    result.pose.is_relocalized = before == State::kLost || is_answered;
    result.pose.state = TrackingState::kTracked;
    if (options_.makes_keyframes && IsKeyframeDue()) {
      if (view->baseline_m() == 0.0) WatchScale();
      result.keyframes.push_back(MakeKeyframe(*last_));
    }
  } else if (before == State::kTracking && !scene_.is_hidden() && search && FollowPair(*search, result.keyframes)) {
    result.pose.state = TrackingState::kTracked;
  } else if (may_ask && CanAskFor(*view)) {
    asked_ = view;
    result.asks_relocalization = true;
    return result;
  } else if (before == State::kInitializing) {
    result.pose.state = Start(view, result.keyframes) ? TrackingState::kTracked : TrackingState::kInitializing;
  } else {
    const bool has_started = NoteLoss(view) && Start(view, result.keyframes);
    result.pose.state = has_started ? TrackingState::kTracked : TrackingState::kLost;
  }
  if (result.pose.state == TrackingState::kTracked) DescribePose(result);
  if (tracked_utime_us_) result.pose.since_tracked_us = features.utime_us - *tracked_utime_us_;
  previous_utime_us_ = features.utime_us;
  return result;
}

// Images of a rendered world repeat for longer, while the camera stands.
bool MapTracker::MayKeepPose(int64_t utime_us) const {
  return state() == State::kTracking && utime_us - last_->frame.view->features().utime_us <= kMaxKept_us;
}

// The camera is where the last frame has it, as far as anybody knows; what the next image shows is a step from there,
// for as long as it took.
MapTrackingResult MapTracker::KeepPose(const FeatureFrame& features) {
  UpdateLast();
  MapTrackingResult result = UndecidedResult(features, last_->frame.view->size());
  result.pose.state = TrackingState::kTracked;
  CountPoints(result.pose);
  DescribePose(result);
  tracked_utime_us_ = last_->frame.view->features().utime_us;
  result.pose.since_tracked_us = features.utime_us - *tracked_utime_us_;
  return result;
}

// For what moves by itself, and what moves with the camera: where something goes by, it isn't the scene that has gone.
// A pose by points that moved with the camera was wrong, and so is what it said of motion and of what stands still. One
// that moved steadily was not by them.
void MapTracker::Watch(const FeatureFrame& features) {
  if (features.frame == watched_frame_) return;
  watched_frame_ = features.frame;
  moving_things_.Add(own_body_.Without(features), ExpectMotion(features.utime_us));
  if (moving_things_.any_goes()) return;
  const int num_before = own_body_.num_found();
  own_body_.Add(features);
  const std::optional<MotionPrediction> motion = motion_.Predict(kDriftInterval_s);
  const bool is_steady = motion && motion->is_steady;
  if (own_body_.num_found() == num_before || is_steady) return;
  scene_ = {};
  ForgetMotion();
}

// Since the last frame, if that was tracked.
std::optional<ExpectedMotion> MapTracker::ExpectMotion(int64_t utime_us) const {
  if (!last_ || last_->frame.view->features().utime_us != previous_utime_us_) return std::nullopt;
  const double interval_s = SecondsOf(utime_us - previous_utime_us_);
  const std::optional<MotionPrediction> motion = interval_s > 0.0 ? motion_.Predict(interval_s) : std::nullopt;
  if (!motion) return std::nullopt;
  ExpectedMotion expected{motion->last_from_current, std::nullopt};
  if (motion->is_steady) expected.max_off_m = kMaxSigmas * std::sqrt(motion->covariance.trace());
  return expected;
}

MapTracker::State MapTracker::state() const {
  if (!last_ && !has_map()) return State::kInitializing;
  return lost_since_us_ || !last_ ? State::kLost : State::kTracking;
}

// The map may have changed: the last frame keeps its pose relative to its reference, and its points move with the map.
void MapTracker::UpdateLast() {
  decision_.Renew(replica_);
  reference_.RenewPoints(replica_);
  if (const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(reference_.id)) {
    if (mending_ && !replica_.sent().contains(mending_->keyframe)) {
      ground_.NoteMended(mending_->since);
      mending_.reset();
    } else {
      ground_.Rescale(world_from_reference->scale / reference_.scale);
    }
    reference_.scale = world_from_reference->scale;
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

// The frame that asked, this one or one before, becomes the last that was tracked. False if the answer does not hold in
// this map, or comes when the camera has been found otherwise, or has begun another part, which a loop will join.
bool MapTracker::TakeAnswer(const RelocalizationAnswer& answer, const Frame& view) {
  if (answer.frame != view->features().frame && state() == State::kTracking) return false;
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
  if (OptimizeFrame(options_.search.pose, frame) < options_.min_relocalized_inliers / 2) return false;
  MatchLocal(LocalPoints(replica_, frame, options_.search.max_local_keyframes),
             options_.search.matching.local_radius_px, options_.search.matching, frame);
  if (OptimizeFrame(options_.search.pose, frame) < options_.min_relocalized_inliers) return false;
  // What hides the scene is in the map by now, too, but not for long.
  const int num_needed = std::max(kMinConfirmed, frame.NumPoints() / 2);
  if (scene_.is_hidden() && NumConfirmed(replica_, frame) < num_needed) return false;
  if (!reference_.id.valid() || replica_.PartOf(reference_.id) != replica_.PartOf(answer.reference)) {
    ground_.ForgetHeight();
  }
  ground_.ForgetSteps();
  mending_.reset();
  reference_ = ReferenceKeyframe{.id = answer.reference, .scale = world_from_reference->scale};
  scale_.GoOnFrom(reference_.id);
  decision_.Restart(frame);
  const Rigid3 reference_from_camera = (world_from_reference->Inverse() * frame.world_from_camera).Pose();
  ForgetMotion();
  scene_.EndHiding();
  last_.emplace(std::move(frame), reference_from_camera);
  return true;
}

bool MapTracker::CanAskFor(const FrameView& view) const {
  return has_map() && view.size() >= options_.min_relocalized_inliers;
}

// Where the motion of a moment ago leads, if the camera turned on as it did, or so; nullopt: none is known. A camera
// that stands may start.
std::optional<ExpectedStep> MapTracker::ExpectStep(const FrameView& view,
                                                   const std::optional<Eigen::Quaterniond>& last_from_current) const {
  const double interval_s = SecondsBetween(*last_->frame.view, view);
  if (interval_s <= 0.0) return std::nullopt;
  std::optional<MotionPrediction> motion =
      last_from_current ? motion_.Predict(interval_s, *last_from_current) : motion_.Predict(interval_s);
  if (!motion) return std::nullopt;
  const Sim3 world_from_reference = WorldFromReference();
  if (motion->is_learned && !motion->is_steady) {
    const double depth = last_->frame.MedianDepth() / world_from_reference.scale;
    const double start = kStart_px * depth / view.calibration().fx_px;
    motion->covariance += start * start * Eigen::Matrix3d::Identity();
  }
  return ExpectedStep{*motion, last_->reference_from_camera, world_from_reference};
}

ExpectedFrame MapTracker::Expect(const FrameView& view) const {
  const std::optional<ExpectedStep> step = ExpectStep(view);
  ExpectedFrame expected;
  expected.world_from_camera = step ? step->WorldFromCamera() : last_->frame.world_from_camera;
  if (step) {
    const MotionPrediction& motion = step->motion;
    const double interval_s = SecondsBetween(*last_->frame.view, view);
    const double direction_sigma_rad =
        std::sqrt(motion.covariance.trace() / 3.0) / motion.last_from_current.translation.norm();
    expected.way = {step->world_from_reference.scale * interval_s * motion_.velocity(), direction_sigma_rad};
    if (motion.is_learned) expected.prior = step->Prior();
    if (motion.is_steady) {
      expected.max_off = kMaxSigmas * step->world_from_reference.scale * std::sqrt(motion.covariance.trace());
    } else if (view.baseline_m() > 0.0) {
      expected.max_off = kMaxAcceleration_mps2 * interval_s * interval_s;
    }
    expected.turn_sigma_rad = motion.turn_sigma_rad;
  }
  return expected;
}

// The frame becomes the last one if its pose can be found in the map around that one.
bool MapTracker::Localize(const CapturedFrame& captured, FrameSearch& search) {
  std::optional<FoundFrame> found;
  if (!lost_since_us_ || IsOnItsWay(*captured.view)) found = search.Follow();
  if (!found) found = search.FindAnywhere();
  if (!found) return false;
  TrackedFrame& frame = found->frame;
  frame.view = times_.AtOneTime(captured, last_->frame, frame, StepTo(frame));
  const KnownPoints around = LocalPoints(replica_, frame, options_.search.max_local_keyframes);
  MatchLocal(around, options_.search.matching.local_radius_px, options_.search.matching, frame);
  const int num_matches = frame.NumPoints();
  const StepPose pose = OptimizeWithMotion(frame);
  if (pose.optimized.num_inliers < MinInliers(num_matches)) return false;
  const int64_t utime_us = frame.view->features().utime_us;
  const MotionAgreement agreement = AgreementOf(*frame.view, frame.world_from_camera, pose.optimized.information);
  if (IsFollowed() && scene_.IsBehind(pose, agreement, utime_us)) {
    scene_.Hide(utime_us);
    return false;
  }
  // Soon after a loss the greater number of inliers says as much.
  const bool is_doubtful =
      lost_since_us_ ? SecondsBetween(*last_->frame.view, *frame.view) > kLongLost_s : found->is_doubtful;
  if (is_doubtful && !scene_.IsSure(pose, agreement, utime_us) && Coverage(around, frame) < kMinCoverage) return false;
  const bool are_few = pose.optimized.num_inliers < kFewInliers;
  if (!lost_since_us_ && are_few && search.PairContradicts(frame.world_from_camera)) return false;
  const int num_outliers = num_matches - frame.NumPoints();
  Remember(std::move(frame), pose, found->is_wide, num_outliers);
  return true;
}

// Whether the camera moved steadily when it was lost a moment ago: it isn't far from where that leads.
bool MapTracker::IsOnItsWay(const FrameView& view) const {
  if (SecondsBetween(*last_->frame.view, view) > kOnItsWay_s) return false;
  const std::optional<ExpectedStep> step = ExpectStep(view);
  return step && step->motion.is_steady;
}

// Points that the last frame saw for the first time are no measure: they may be on something that moves.
int MapTracker::MinInliers(int num_matches) const {
  if (lost_since_us_) return options_.min_relocalized_inliers;
  const int num_last = last_->num_known > 0 ? std::max(last_->num_known, num_matches) : last_->frame.NumPoints();
  return std::max(options_.min_inliers, static_cast<int>(options_.min_share_of_last * num_last));
}

// Of a camera that turned so, to how it moved a moment ago. `information`: about the pose.
MotionAgreement MapTracker::AgreementOf(const FrameView& view, const Rigid3& world_from_camera,
                                        const Matrix6d& information) const {
  const Rigid3 last_from_current = last_->frame.world_from_camera.Inverse() * world_from_camera;
  const std::optional<ExpectedStep> expected = ExpectStep(view, last_from_current.rotation);
  if (!expected || !expected->motion.is_learned) return MotionAgreement::kOpen;
  if (!IsJump(expected->motion, expected->MotionTo(world_from_camera), expected->CovarianceBy(information))) {
    return expected->motion.is_steady ? MotionAgreement::kGoesOn : MotionAgreement::kOpen;
  }
  const double shift = (world_from_camera.translation - expected->WorldFromCamera().translation).norm();
  const bool is_seen = view.calibration().fx_px * shift > kMinJump_px * last_->frame.MedianDepth();
  return is_seen ? MotionAgreement::kJumps : MotionAgreement::kOpen;
}

StepPose MapTracker::OptimizeWithMotion(TrackedFrame& frame) const {
  const std::optional<ExpectedStep> expected = lost_since_us_ ? std::nullopt : ExpectStep(*frame.view);
  const bool is_learned = expected && expected->motion.is_learned;
  return OptimizeStep(replica_, options_.search.pose, is_learned ? &*expected : nullptr, frame);
}

// From the last frame; nullopt: it isn't one that followed it.
std::optional<CaptureTimes::Step> MapTracker::StepTo(const TrackedFrame& frame) const {
  const double interval_s = SecondsBetween(*last_->frame.view, *frame.view);
  if (!IsFollowed() || interval_s <= 0.0) return std::nullopt;
  return CaptureTimes::Step{last_->frame.world_from_camera.Inverse() * frame.world_from_camera, interval_s};
}

void MapTracker::Remember(TrackedFrame frame, const StepPose& pose, bool is_wide_step, int num_outliers) {
  const Sim3 world_from_reference = WorldFromReference();
  const Sim3 reference_from_world = world_from_reference.Inverse();
  const Rigid3 reference_from_camera = (reference_from_world * frame.world_from_camera).Pose();
  const Eigen::Matrix3d covariance =
      TranslationCovariance(pose.optimized.information) * reference_from_world.scale * reference_from_world.scale;
  const std::optional<CaptureTimes::Step> step = StepTo(frame);
  // After a step that contradicts it, nothing is known of how the camera moves: it may have been carried away.
  if (!step || pose.evidence == StepEvidence::kContradictory) {
    ForgetMotion();
  } else {
    motion_.Add(last_->reference_from_camera.Inverse() * reference_from_camera, covariance, step->interval_s,
                pose.evidence == StepEvidence::kWeak);
  }
  if (step) WatchGround(frame, *step, pose);
  times_.Follow(step);
  if (replica_.WorldFromKeyframe(reference_.id)) times_.Learn(frame, world_from_reference.Pose(), replica_);
  lost_since_us_.reset();
  scene_.See(pose, frame.view->features().utime_us);
  const int num_known = frame.NumPoints();
  std::optional<PoseInfluences> influences = InfluencesOn(frame);
  std::optional<Matrix6d> way_covariance;
  if (influences) way_covariance = reference_.WayCovarianceTo(frame, *influences, world_from_reference.Pose());
  last_.emplace(std::move(frame), reference_from_camera, covariance, std::move(influences), way_covariance, num_known,
                num_outliers, is_wide_step, pose.is_doubtful);
}

// Where hardly a known point is left in view, the way on is what the last frame and this one show by themselves: both
// become keyframes, and what they see is new.
bool MapTracker::FollowPair(FrameSearch& search, std::vector<KeyframeObservation>& keyframes) {
  if (!options_.makes_keyframes) return false;
  const std::optional<Rigid3> world_from_camera = search.PoseByPair();
  if (!world_from_camera) return false;
  const int64_t utime_us = search.view()->features().utime_us;
  if (scene_.WasConfirmed(utime_us) &&
      AgreementOf(*search.view(), *world_from_camera, kExact * Matrix6d::Identity()) == MotionAgreement::kJumps) {
    scene_.Hide(utime_us);
    return false;
  }
  const double interval_s = SecondsBetween(*last_->frame.view, *search.view());
  if (!reference_.frame || reference_.frame->view != last_->frame.view) keyframes.push_back(MakeKeyframe(*last_));
  times_.ForgetMotion();
  TrackedFrame frame(search.view());
  frame.world_from_camera = *world_from_camera;
  MatchLast(last_->frame, options_.search.matching.last_radius_px, options_.search.matching, frame);
  const int num_agreeing = OptimizeFrame(options_.search.pose, frame);  // leaves points that agree with one another
  const bool has_depth = frame.view->baseline_m() > 0.0;
  if (!has_depth || num_agreeing < options_.min_inliers) frame.world_from_camera = *world_from_camera;
  const Rigid3 reference_from_camera = (WorldFromReference().Inverse() * frame.world_from_camera).Pose();
  const double sigma = kPairSigmaShare * reference_from_camera.translation.norm();
  const Eigen::Matrix3d covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  if (interval_s > 0.0) motion_.Add(reference_from_camera, covariance, interval_s, true);
  last_.emplace(LocalizedFrame{.frame = std::move(frame),
                               .reference_from_camera = reference_from_camera,
                               .covariance = covariance,
                               .is_wide_step = true});
  WatchScale();
  keyframes.push_back(MakeKeyframe(*last_));
  return true;
}

bool MapTracker::Start(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  ForgetMotion();
  scene_.EndHiding();
  return view->baseline_m() > 0.0 ? StartFromDepth(view, keyframes) : StartFromPair(view, keyframes);
}

bool MapTracker::StartFromDepth(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  int num_points = 0;
  for (int i = 0; i < view->size(); ++i) num_points += view->observation(i).has_right() ? 1 : 0;
  if (num_points < options_.min_start_points) return false;
  reference_ = {};
  const Rigid3 world_from_camera = lost_way_.PoseAt(view->features().utime_us);
  last_.emplace(TrackedFrame(view), world_from_camera);
  last_->frame.world_from_camera = world_from_camera;
  keyframes.push_back(MakeKeyframe(*last_));
  return true;
}

// Both frames become keyframes; the points go with the second one, as seen by a keypoint of each.
bool MapTracker::StartFromPair(const Frame& view, std::vector<KeyframeObservation>& keyframes) {
  const std::optional<MonoStart> start =
      start_.Add(view, {lost_way_.speed(), tracked_utime_us_}, next_keyframe_, ground_);
  if (!start) return false;
  reference_ = {};
  mending_.reset();
  scale_.Restart();
  const Rigid3 world_from_first = lost_way_.PoseAt(start->first->features().utime_us);
  LocalizedFrame first{TrackedFrame(start->first), world_from_first};
  first.frame.world_from_camera = world_from_first;
  const KeyframeId first_id = next_keyframe_;
  keyframes.push_back(MakeKeyframe(first));

  const Rigid3 first_from_second = start->second_from_first.Inverse();
  last_.emplace(TrackedFrame(start->second), first_from_second);
  last_->frame.world_from_camera = world_from_first * first_from_second;
  SentKeyframe sent{{}, world_from_first, {}};
  for (const MonoStart::Point& point : start->points) {
    const Landmark in_camera =
        PointOf(*start->first, point.keypoint_first, point.point.point_in_world, &point.point.covariance);
    sent.points[point.keypoint_first] = in_camera;
    last_->frame.points[Index(point.keypoint_second)] = {{{}, first_id, point.keypoint_first},
                                                         InWorld(Sim3::From(world_from_first), in_camera)};
  }
  replica_.Send(first_id, std::move(sent));
  if (start->interval_s() > 0.0) motion_.Guess(first_from_second, start->interval_s());
  keyframes.push_back(MakeKeyframe(*last_));
  return true;
}

// Whether the loss has lasted so long that a new part of the map should begin.
bool MapTracker::NoteLoss(const Frame& view) {
  const int64_t utime_us = view->features().utime_us;
  if (!lost_since_us_) {
    lost_since_us_ = utime_us;
    if (last_ && scene_.is_known() && StoodStill()) scene_.Hide(utime_us);
  }
  if (last_ && !lost_way_.has_begun()) BeginLostWay();
  if (lost_way_.has_begun() && !scene_.is_hidden()) lost_way_.Add(view);
  const int64_t max_unlocated_us = tracked_utime_us_ ? 0 : options_.max_unlocated_us;
  if (scene_.is_hidden()) scene_.Hide(utime_us);
  const int64_t max_hidden_us = scene_.is_hidden() ? HiddenScene::kMaxHidden_us : 0;
  const int64_t max_lost_us = std::max({options_.max_lost_us, max_unlocated_us, max_hidden_us});
  if (utime_us - *lost_since_us_ <= max_lost_us || !options_.makes_keyframes) return false;
  if (last_) {
    last_.reset();
    start_.Restart();
  }
  return true;
}

// Whether the camera stood still when it was seen last: then it is something else that moved.
bool MapTracker::StoodStill() const {
  const auto motion = motion_.Predict(kDriftInterval_s);
  if (!motion || !motion->is_learned || motion->is_steady) return false;
  const double depth = last_->frame.MedianDepth() / WorldFromReference().scale;
  const double fx_px = last_->frame.view->calibration().fx_px;
  const double turn = LogSO3(motion->last_from_current.rotation).norm();
  return fx_px * motion->last_from_current.translation.norm() < kMaxStanding_px * depth &&
         fx_px * turn < kMaxStanding_px;
}

void MapTracker::BeginLostWay() {
  const auto motion = motion_.Predict(kDriftInterval_s, Eigen::Quaterniond::Identity());
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  if (motion && motion->is_steady) {
    velocity = WorldFromReference().scale * motion->last_from_current.translation / kDriftInterval_s;
  }
  const Eigen::Vector3d turn_rate = motion_.is_known() ? motion_.turn_rate() : Eigen::Vector3d::Zero();
  lost_way_.Begin(last_->frame.view, last_->frame.world_from_camera, velocity, turn_rate);
}

void MapTracker::ForgetMotion() {
  motion_.Reset();
  reference_.motion.reset();
  times_.ForgetMotion();
}

bool MapTracker::IsKeyframeDue() {
  const TrackedFrame& frame = last_->frame;
  const double near_m = options_.depth.max_baselines * frame.view->baseline_m();
  KeyframeDecision::NearKeypoints near;
  for (int i = 0; near_m > 0.0 && i < frame.view->size(); ++i) {
    const auto point = PointFromDepth(frame.view->features(), i);
    if (!point || point->z() > near_m) continue;
    (frame.points[Index(i)].valid() ? near.num_known : near.num_new) += 1;
  }
  const Rigid3 world_from_reference = WorldFromReference().Pose();
  const int64_t interval_us = frame.view->features().utime_us - previous_utime_us_;
  const bool has_news = own_body_.num_found() >= num_body_told_ + kNewsOfBody;
  const bool is_due = decision_.Decide(frame, interval_us, world_from_reference, near) || has_news;
  return is_due && static_cast<int>(replica_.sent().size()) < options_.max_unanswered_keyframes;
}

// The frame becomes the reference of those to come.
KeyframeObservation MapTracker::MakeKeyframe(LocalizedFrame& localized) {
  TrackedFrame& frame = localized.frame;
  const KeyframeId id = next_keyframe_;
  const bool begins_part = !reference_.id.valid();
  KeyframeObservation keyframe = ObserveKeyframe(id, localized, calibration_, reference_, replica_);
  keyframe.not_scene = LandmarksOnBody(id);
  if (!begins_part && !mending_) {
    keyframe.mendings = ground_.Mendings();
    if (!keyframe.mendings.empty()) mending_ = {id, keyframe.mendings.back().keyframe};
  }
  SentKeyframe sent{reference_.id, localized.reference_from_camera, {}};
  // Points that one view alone knows are no measure of what should be seen again, unless there are no others.
  const bool has_known_points = frame.NumPoints() > 0;
  if (has_known_points) decision_.Restart(frame);
  AddDepthPoints(id, options_.depth, frame, sent);
  AddPairPoints(reference_, replica_, localized, keyframe, sent);
  if (!has_known_points) decision_.Restart(frame);
  replica_.Send(id, std::move(sent));
  if (begins_part) {
    way_corrections_.BeginPart(frame.view->baseline_m() == 0.0);
  } else if (localized.way_covariance) {
    way_corrections_.Send(reference_.id, id, localized.reference_from_camera, *localized.way_covariance);
  }
  reference_ = {.id = id,
                .scale = reference_.scale,
                .frame = frame,
                .motion = ReferenceKeyframe::MotionAt{motion_, keyframe.features.utime_us},
                .influences = InfluencesOnReference(localized, begins_part)};
  times_.BecomeReference(id);
  ++next_keyframe_.value;
  localized.reference_from_camera = Rigid3::Identity();
  return keyframe;
}

// Landmarks of the map that moved with the camera, while there is news of them.
std::vector<LandmarkId> MapTracker::LandmarksOnBody(KeyframeId keyframe) {
  if (own_body_.num_found() > num_body_told_) {
    num_body_told_ = own_body_.num_found();
    tells_body_until_ = {keyframe.value + options_.max_unanswered_keyframes};
  }
  return keyframe <= tells_body_until_ ? LandmarksOn(own_body_, replica_.map()) : std::vector<LandmarkId>();
}

void MapTracker::WatchScale() {
  const TrackedFrame& frame = last_->frame;
  const Sim3 world_from_reference = WorldFromReference();
  const bool is_since_kept = replica_.WorldFromKeyframe(scale_.since()).has_value();
  const KeyframeId from = is_since_kept ? scale_.since() : reference_.id;
  const Sim3 world_from_start = replica_.WorldFromKeyframe(from).value_or(world_from_reference);
  const Eigen::Vector3d way = frame.world_from_camera.translation - world_from_start.translation;
  scale_.Add(next_keyframe_, frame.view->features().utime_us,
             frame.world_from_camera.rotation.conjugate() * way / world_from_reference.scale,
             last_->covariance.value_or(Eigen::Matrix3d::Zero()), ShareKnownAt(replica_.map(), from, frame));
}

void MapTracker::WatchGround(const TrackedFrame& frame, const CaptureTimes::Step& step, const StepPose& pose) {
  const Rigid3& last_from_current = step.last_from_current;
  const double length = last_from_current.translation.norm();
  if (frame.view->baseline_m() > 0.0 || length == 0.0) return;
  const Eigen::Matrix3d covariance = TranslationCovariance(pose.optimized.information);
  const Eigen::Vector3d direction = last_from_current.rotation.conjugate() * last_from_current.translation / length;
  const double variance_across = 0.5 * (covariance.trace() - direction.dot(covariance * direction));
  ground_.Add(*last_->frame.view, *frame.view,
              {last_from_current, step.interval_s, std::sqrt(std::max(variance_across, 0.0)) / length,
               pose.evidence != StepEvidence::kWeak, reference_.id});
}

MapTrackingResult MapTracker::UndecidedResult(const FeatureFrame& features, int num_features) const {
  MapTrackingResult result;
  result.pose.frame = features.frame;
  result.pose.utime_us = features.utime_us;
  result.pose.captured_us = features.captured_us;
  result.pose.num_features = num_features;
  result.pose.num_landmarks = static_cast<int32_t>(replica_.map().landmarks().size());
  return result;
}

// To be called before a new keyframe adds points, which would agree with a pose that they had no part in.
void MapTracker::CountPoints(PoseEstimate& pose) const {
  pose.num_inliers = last_->frame.NumPoints();
  pose.num_matches = pose.num_inliers + last_->num_outliers;
  pose.coverage = CellCoverage(last_->frame);
}

// The frame was tracked, and is now the last one.
void MapTracker::DescribePose(MapTrackingResult& result) {
  lost_since_us_.reset();
  lost_way_.End();
  result.pose.world_from_camera = last_->frame.world_from_camera;
  result.pose.reference_keyframe = reference_.id;
  result.pose.reference_from_camera = last_->reference_from_camera;
  result.pose.map_part = replica_.PartOf(reference_.id);
  if (result.pose.num_inliers == 0) CountPoints(result.pose);  // a map begins: its first points
  result.pose.is_keyframe = !result.keyframes.empty();
  result.pose.is_step_doubtful = last_->is_doubtful;
  result.pose.scale_sigma = std::max(scale_.RecentDrift(result.pose.utime_us), ground_.ScaleFall());
  result.pose.body = DescribeBody();
  tracked_utime_us_ = result.pose.utime_us;
  reference_.scale = WorldFromReference().scale;
}

// The camera as a body of its own.
BodyState MapTracker::DescribeBody() const {
  BodyState body{.world_from_base = last_->frame.world_from_camera};
  const std::optional<double> variance_factor = way_corrections_.variance_factor();
  if (last_->way_covariance && variance_factor) {
    body.covariance = *variance_factor * *last_->way_covariance;
    body.has_covariance = true;
  }
  if (motion_.is_known()) {
    body.motion = {WorldFromReference().scale * motion_.velocity(), motion_.turn_rate()};
    body.has_motion = true;
  }
  return body;
}

}  // namespace tessera
