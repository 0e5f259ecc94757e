#include "tracking/map_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "matching/frame_pose.h"
#include "measurement/landmark_description.h"
#include "tracking/confirmed_points.h"
#include "tracking/local_points.h"
#include "tracking/pair_points.h"

namespace tessera {
namespace {

// Of the points that agree on a pose by themselves: fewer that agree with the motion of a moment ago contradict it.
constexpr double kMinShareWithMotion = 0.5;
// Of points that agree with one pose and with another, and of their residuals: neither is better.
constexpr double kSameShare = 0.97, kSameRms = 1.15;
constexpr double kDriftInterval_s = 0.1;
constexpr double kMinCoverage = 0.4;     // see Coverage(): of a pose that no try has found clearly
constexpr double kLongLost_s = 2.0;      // since the last pose: the camera may be where nothing is known of
constexpr int kMaxSharedAtPair = 100;    // with fewer known points, a wide pair's points go to the mapper as well
constexpr double kOpenShare = 0.01;      // of a way from keyframe to keyframe: see IsWayOpen()
constexpr int kFewInliers = 100;         // that agree with a pose: what two frames as such show counts more
constexpr double kPairSigmaShare = 0.2;  // of a step that two frames by themselves have shown
// Where depth is measured, no scale can slip, and a hand jerks: what moves the image by less than this is no doubt.
constexpr double kMinDoubtfulShift_px = 10.0;
// What a camera that stood goes until the next frame, in the image: a standard deviation.
constexpr double kStart_px = 1.0;
// Of two frames, for their poses to tell how the camera moved while an image was read.
constexpr double kMaxFrameInterval_s = 0.07;
constexpr double kMinDelay_s = 0.001;  // of depths: in less, a turn moves an image by less than a pixel

// `are_shared`: other frames may see the same points.
PoseInfluences ByPoint(PoseInfluences influences, bool are_shared) {
  for (PointInfluence& influence : influences) {
    if (!are_shared) influence.point = {};
  }
  if (!std::ranges::is_sorted(influences, {}, &PointInfluence::point)) {
    std::ranges::stable_sort(influences, {}, &PointInfluence::point);
  }
  return influences;
}

double SecondsBetween(const FrameView& first, const FrameView& second) {
  return 1e-6 * static_cast<double>(second.features().utime_us - first.features().utime_us);
}

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

// Points beside one another err alike, which no covariance knows of: a thousand of them on one wall seem to fix how the
// camera went along it by a hundredth of their noise. Whether as many agree with this pose, and nearly as well.
bool FitsAsWell(const PoseOptimizationResult& pose, const PoseOptimizationResult& other) {
  return pose.num_inliers >= kSameShare * other.num_inliers && pose.rms <= kSameRms * other.rms;
}

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
    : options_(options), initializer_(options.start), decision_(options.keyframes) {
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
  const CameraView taken = Taken(features);
  const Frame& view = taken.view;
  calibration_ = features.calibration;
  const State before = state();
  MapTrackingResult result = UndecidedResult(*view);
  if (last_) UpdateLast();
  const bool is_answered = answer != nullptr && TakeAnswer(*answer, view);
  if (is_answered) result.pose.relocalized_by = answer->frame;
  // The answer may be for this frame, which it has localized then, or for one before, which this one follows.
  const bool is_localized = is_answered && answer->frame == features.frame;

  std::optional<FrameSearch> search;
  if (last_ && !is_localized) search.emplace(SearchFor(taken));
  if (is_localized || (search && Localize(taken, *search))) {
    CountPoints(result.pose);
    result.pose.is_relocalized = before == State::kLost || is_answered;
    result.pose.state = TrackingState::kTracked;
    if (options_.makes_keyframes && IsKeyframeDue()) {
      if (view->baseline_m() == 0.0) WatchScale(last_->reference_from_camera);
      result.keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
    }
  } else if (before == State::kTracking && search && FollowPair(*search, result.keyframes)) {
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
  if (tracked_utime_us_) result.pose.since_tracked_us = features.utime_us - *tracked_utime_us_;
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
  result.pose.captured_us = view.features().captured_us;
  result.pose.num_features = view.size();
  result.pose.num_landmarks = static_cast<int32_t>(replica_.map().landmarks().size());
  return result;
}

bool MapTracker::CanAskFor(const FrameView& view) const {
  return has_map() && view.size() >= options_.min_relocalized_inliers;
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
  result.pose.world_from_camera = last_->frame.world_from_camera;
  result.pose.reference_keyframe = reference_;
  result.pose.reference_from_camera = last_->reference_from_camera;
  result.pose.map_part = replica_.PartOf(reference_);
  if (result.pose.num_inliers == 0) CountPoints(result.pose);  // a map begins: its first points
  result.pose.is_keyframe = !result.keyframes.empty();
  result.pose.is_step_doubtful = last_->is_doubtful;
  result.pose.scale_sigma = std::max(scale_.RecentDrift(result.pose.utime_us), ground_.ScaleFall());
  result.pose.body = DescribeBody();
  tracked_utime_us_ = result.pose.utime_us;
  reference_scale_ = WorldFromReference().scale;
}

// The camera as a body of its own.
BodyState MapTracker::DescribeBody() const {
  BodyState body{.world_from_base = last_->frame.world_from_camera};
  const std::optional<double> variance_factor = way_corrections_.variance_factor();
  if (last_->pose_covariance && variance_factor) {
    body.covariance = *variance_factor * *last_->pose_covariance;
    body.has_covariance = true;
  }
  if (motion_.is_known()) {
    body.motion = {WorldFromReference().scale * motion_.velocity(), motion_.turn_rate()};
    body.has_motion = true;
  }
  return body;
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
  scale_.Restart();
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
  const double interval_s = SecondsBetween(*start->first, *start->second);
  if (interval_s > 0.0) motion_.Guess(first_from_second, interval_s);
  last_.emplace(Last{std::move(second), Rigid3::Identity()});
  keyframes.push_back(MakeKeyframe(last_->frame, first_id, first_from_second));
  return true;
}

// Two views don't know how far apart they are: as far as the ground tells, or as the camera goes in that time, if it
// still moves as it did when it was lost, and on its way from there. That is a guess until a loop joins the parts.
void MapTracker::TakeOverMotion(MonoStart& start) {
  const double interval_s = SecondsBetween(*start.first, *start.second);
  std::optional<double> length = LengthByGround(start, interval_s);
  if (!length && drift_) length = drift_->velocity.norm() * interval_s;
  if (!length) {
    ground_.ForgetHeight();
    return;
  }
  const double scale = *length / start.second_from_first.translation.norm();
  start.second_from_first.translation *= scale;
  for (MonoStart::Point& point : start.points) {
    point.point.point_in_world *= scale;
    point.point.covariance *= scale * scale;
  }
  if (!drift_) return;
  const double lost_s = 1e-6 * static_cast<double>(start.first->features().utime_us - drift_->utime_us);
  world_from_start_ = world_from_start_ * Rigid3{Eigen::Quaterniond::Identity(), drift_->velocity * lost_s};
  drift_.reset();
}

std::optional<double> MapTracker::LengthByGround(const MonoStart& start, double interval_s) {
  if (!tracked_utime_us_ || interval_s <= 0.0) return std::nullopt;
  const double gap_s = 1e-6 * static_cast<double>(start.first->features().utime_us - *tracked_utime_us_);
  return ground_.LengthAfterGap(*start.first, *start.second, start.second_from_first.Inverse(), interval_s,
                                std::max(gap_s, 0.0));
}

// The map may have changed: the last frame keeps its pose relative to its reference, and its points move with the map.
void MapTracker::UpdateLast() {
  decision_.Renew(replica_);
  if (reference_influences_) {
    for (PointInfluence& influence : *reference_influences_) influence.point = replica_.Renew(influence.point);
    *reference_influences_ = ByPoint(std::move(*reference_influences_), true);
  }
  if (const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(reference_)) {
    ground_.Rescale(world_from_reference->scale / reference_scale_);
    reference_scale_ = world_from_reference->scale;
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

// Where the motion so far leads.
ExpectedFrame MapTracker::Expect(const FrameView& view) const {
  const std::optional<MotionPrediction> motion = PredictMotion(view);
  const Rigid3 last_from_current = motion ? motion->last_from_current : Rigid3::Identity();
  const Sim3 world_from_reference = WorldFromReference();
  ExpectedFrame expected;
  expected.world_from_camera = (world_from_reference * (last_->reference_from_camera * last_from_current)).Pose();
  if (motion) {
    const double way = motion->last_from_current.translation.norm();
    const double direction_sigma_rad = std::sqrt(motion->covariance.trace() / 3.0) / way;
    expected.way = {world_from_reference.scale * SinceLast(view) * motion_.velocity(), direction_sigma_rad};
    if (motion->is_learned) expected.prior = PriorOf(*motion);
    expected.turn_sigma_rad = motion->turn_sigma_rad;
  }
  return expected;
}

FrameSearch MapTracker::SearchFor(const CameraView& taken) const {
  return {AtOneTime(taken, TrackedFrame(taken.view), last_->mean_motion), last_->frame, Expect(*taken.view), replica_,
          options_.search};
}

// The frame becomes the last one if its pose can be found in the map around that one.
bool MapTracker::Localize(const CameraView& taken, FrameSearch& search) {
  std::optional<FoundFrame> found;
  if (!lost_since_us_) found = search.Follow();
  if (!found) found = search.FindAnywhere();
  if (!found) return false;
  TrackedFrame& frame = found->frame;
  frame.view = AtOneTime(taken, frame, MotionOf(frame));
  const KnownPoints around = LocalPoints(replica_, frame, options_.search.max_local_keyframes);
  MatchLocal(around, options_.search.matching.local_radius_px, options_.search.matching, frame);
  const int min_of_last = static_cast<int>(options_.min_share_of_last * last_->frame.NumPoints());
  const int min_inliers =
      lost_since_us_ ? options_.min_relocalized_inliers : std::max(options_.min_inliers, min_of_last);
  const int num_matches = frame.NumPoints();
  const FramePose pose = OptimizeWithMotion(frame);
  if (pose.optimized.num_inliers < min_inliers) return false;
  // Soon after a loss the greater number of inliers says as much.
  const bool is_doubtful = lost_since_us_ ? SinceLast(*frame.view) > kLongLost_s : found->is_doubtful;
  if (is_doubtful && Coverage(around, frame) < kMinCoverage) return false;
  const bool are_few = pose.optimized.num_inliers < kFewInliers;
  if (!lost_since_us_ && are_few && search.PairContradicts(frame.world_from_camera)) return false;
  const int num_outliers = num_matches - frame.NumPoints();
  Remember(std::move(frame), pose, found->is_wide);
  last_->num_outliers = num_outliers;
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

MapTracker::CameraView MapTracker::Taken(const FeatureFrame& features) const {
  CameraView taken{std::make_shared<const FrameView>(WithLens(features, replica_.map().lens()))};
  const double delay_s = 1e-6 * static_cast<double>(features.depth_delay_us) + depth_delay_.delay_s();
  if (std::abs(delay_s) >= kMinDelay_s) {
    taken.depth_delay_s = delay_s;
    taken.surfaces = SurfacesOf(*taken.view);
  }
  return taken;
}

// As the keypoints would be seen, and their depths measured, if all of it were done at the frame's time.
MapTracker::Frame MapTracker::AtOneTime(const CameraView& taken, const TrackedFrame& frame,
                                        const std::optional<CameraMotion>& motion) const {
  const bool is_rolling = readout_.readout_s() > 0.0, is_late = taken.depth_delay_s != 0.0;
  if (!motion || (!is_rolling && !is_late)) return taken.view;
  FeatureFrame features =
      is_late ? WithDepthsOfImage(*taken.view, taken.surfaces, taken.depth_delay_s, *motion) : taken.view->features();
  return std::make_shared<const FrameView>(is_rolling ? Unrolled(features, frame, *motion) : std::move(features));
}

// With the depths of the points that `frame` sees, where it sees any.
FeatureFrame MapTracker::Unrolled(const FeatureFrame& rolled, const TrackedFrame& frame,
                                  const CameraMotion& motion) const {
  const double usual_depth = last_->frame.MedianDepth();
  const Rigid3 camera_from_world = frame.world_from_camera.Inverse();
  std::vector<double> depths(frame.points.size(), usual_depth);
  for (size_t i = 0; i < depths.size(); ++i) {
    const auto measured_m = static_cast<double>(rolled.keypoints[i].depth_m);
    if (frame.points[i].valid()) {
      depths[i] = (camera_from_world * frame.points[i].landmark.position_in_world).z();
    } else if (measured_m > 0.0) {
      depths[i] = measured_m;
    }
  }
  return Unroll(rolled, depths, readout_.readout_s(), motion);
}

// One that stands may start.
std::optional<MotionPrediction> MapTracker::PredictMotion(const FrameView& view) const {
  const double interval_s = SinceLast(view);
  std::optional<MotionPrediction> motion = interval_s > 0.0 ? motion_.Predict(interval_s) : std::nullopt;
  if (motion && motion->is_learned && !motion->is_steady) {
    const double depth = last_->frame.MedianDepth() / WorldFromReference().scale;
    const double start = kStart_px * depth / view.calibration().fx_px;
    motion->covariance += start * start * Eigen::Matrix3d::Identity();
  }
  return motion;
}

double MapTracker::SinceLast(const FrameView& view) const { return SecondsBetween(*last_->frame.view, view); }

Sim3 MapTracker::WorldFromReference() const { return replica_.WorldFromKeyframe(reference_).value_or(Sim3{}); }

// Where the motion of a moment ago takes the camera.
PosePrior MapTracker::PriorOf(const MotionPrediction& motion) const {
  const Sim3 world_from_reference = WorldFromReference();
  const double area = world_from_reference.scale * world_from_reference.scale;
  const Rigid3 reference_from_expected = last_->reference_from_camera * motion.last_from_current;
  return {(world_from_reference * reference_from_expected).Pose().Inverse(), (motion.covariance * area).inverse()};
}

// By the images alone where they fix how far the camera went, else carried by how it moved a moment ago. Which points
// are outliers is told with the motion: wrong matches that agree on another one can't win.
MapTracker::FramePose MapTracker::OptimizeWithMotion(TrackedFrame& frame) const {
  const std::optional<MotionPrediction> motion = lost_since_us_ ? std::nullopt : PredictMotion(*frame.view);
  if (!motion || !motion->is_learned) {
    return {OptimizeByConfirmed(replica_, options_.search.pose, nullptr, frame), StepEvidence::kStrong};
  }
  const PosePrior prior = PriorOf(*motion);
  TrackedFrame carried = frame;
  const PoseOptimizationResult with_motion = OptimizeByConfirmed(replica_, options_.search.pose, &prior, carried);
  TrackedFrame seen = carried;
  PoseOptimizationResult by_images = OptimizeByConfirmed(replica_, options_.search.pose, nullptr, seen);
  // Unless most points contradict the motion: the camera may have been carried away. That is told, not overruled.
  bool do_points_contradict = false;
  if (by_images.num_inliers < kMinShareWithMotion * frame.NumPoints()) {
    TrackedFrame alone = frame;
    const PoseOptimizationResult by_all = OptimizeByConfirmed(replica_, options_.search.pose, nullptr, alone);
    do_points_contradict = by_images.num_inliers < kMinShareWithMotion * by_all.num_inliers;
    if (do_points_contradict) {
      by_images = by_all;
      seen = std::move(alone);
    }
  }
  const Sim3 world_from_reference = WorldFromReference();
  const double area = world_from_reference.scale * world_from_reference.scale;
  const Rigid3 reference_from_camera = (world_from_reference.Inverse() * seen.world_from_camera).Pose();
  StepEvidence evidence = Judge(*motion, last_->reference_from_camera.Inverse() * reference_from_camera,
                                TranslationCovariance(by_images.information) / area);
  // Mono's map is made of such steps: there it was no help.
  if (evidence == StepEvidence::kContradictory && !do_points_contradict && frame.view->baseline_m() > 0.0) {
    TrackedFrame alone = frame;
    const PoseOptimizationResult by_all = OptimizeByConfirmed(replica_, options_.search.pose, nullptr, alone);
    if (FitsAsWell(with_motion, by_all)) evidence = StepEvidence::kWeak;
  }
  const bool is_carried = evidence == StepEvidence::kWeak;
  frame = std::move(is_carried ? carried : seen);
  return {is_carried ? with_motion : by_images, evidence};
}

// Where hardly a known point is left in view, the way on is what the last frame and this one show by themselves: both
// become keyframes, and what they see is new.
bool MapTracker::FollowPair(FrameSearch& search, std::vector<KeyframeObservation>& keyframes) {
  if (!options_.makes_keyframes) return false;
  const std::optional<Rigid3> world_from_camera = search.PoseByPair();
  if (!world_from_camera) return false;
  const double interval_s = SinceLast(*search.view());
  if (!reference_frame_ || reference_frame_->view != last_->frame.view) {
    keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
  }
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
  last_.emplace(Last{std::move(frame), reference_from_camera, StepEvidence::kWeak, covariance, std::nullopt, true});
  WatchScale(reference_from_camera);
  keyframes.push_back(MakeKeyframe(last_->frame, reference_, last_->reference_from_camera));
  return true;
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
  if (!reference_.valid() || replica_.PartOf(reference_) != replica_.PartOf(answer.reference)) ground_.ForgetHeight();
  reference_ = answer.reference;
  reference_scale_ = world_from_reference->scale;
  reference_frame_.reset();
  reference_influences_.reset();
  decision_.Restart(frame);
  const Rigid3 reference_from_camera = (world_from_reference->Inverse() * frame.world_from_camera).Pose();
  ResetMotion();
  last_.emplace(Last{std::move(frame), reference_from_camera});
  return true;
}

void MapTracker::Remember(TrackedFrame frame, const FramePose& pose, bool is_wide_step) {
  const Sim3 reference_from_world = WorldFromReference().Inverse();
  const Rigid3 reference_from_camera = (reference_from_world * frame.world_from_camera).Pose();
  const double interval_s = SinceLast(*frame.view);
  const bool is_doubtful = pose.evidence == StepEvidence::kContradictory && IsDoubtful(frame, reference_from_camera);
  // After a step that contradicts it, nothing is known of how the camera moves: it may have been carried away.
  const Eigen::Matrix3d covariance =
      TranslationCovariance(pose.optimized.information) * reference_from_world.scale * reference_from_world.scale;
  if (lost_since_us_ || interval_s <= 0.0 || pose.evidence == StepEvidence::kContradictory) {
    ResetMotion();
  } else {
    motion_.Add(last_->reference_from_camera.Inverse() * reference_from_camera, covariance, interval_s,
                pose.evidence == StepEvidence::kWeak);
  }
  WatchGround(frame, pose);
  camera_motion_ = MotionOf(frame);
  const std::optional<CameraMotion> mean_motion = MeanMotionOf(frame);
  LearnTimes(frame);
  lost_since_us_.reset();
  std::optional<PoseInfluences> influences = InfluencesOn(frame);
  const std::optional<Matrix6d> pose_covariance = CovarianceFromReference(frame, influences);
  last_.emplace(Last{std::move(frame), reference_from_camera, pose.evidence, covariance, mean_motion, is_wide_step,
                     std::move(influences), pose_covariance});
  last_->is_doubtful = is_doubtful;
}

// Of a step that contradicts the motion of a moment ago: whether it may be wrong by much.
bool MapTracker::IsDoubtful(const TrackedFrame& frame, const Rigid3& reference_from_camera) const {
  const std::optional<MotionPrediction> motion = PredictMotion(*frame.view);
  if (frame.view->baseline_m() == 0.0 || !motion) return true;
  const Rigid3 last_from_current = last_->reference_from_camera.Inverse() * reference_from_camera;
  const double difference = (last_from_current.translation - motion->last_from_current.translation).norm();
  return frame.view->calibration().fx_px * difference > kMinDoubtfulShift_px * frame.MedianDepth();
}

// Both ends of the way are as uncertain as their own frames' points leave them.
std::optional<Matrix6d> MapTracker::CovarianceFromReference(const TrackedFrame& frame,
                                                            const std::optional<PoseInfluences>& influences) {
  if (!influences) return std::nullopt;
  if (!reference_influences_) reference_influences_ = ByPoint(*influences, false);
  return WayCovariance(*reference_influences_, *influences,
                       frame.world_from_camera.Inverse() * WorldFromReference().Pose());
}

void MapTracker::LearnTimes(const TrackedFrame& frame) {
  const std::optional<Sim3> world_from_reference = replica_.WorldFromKeyframe(reference_);
  if (!camera_motion_ || !camera_motion_at_reference_ || !world_from_reference) return;
  const MovingView reference{world_from_reference->Pose(), *camera_motion_at_reference_};
  readout_.Add(frame, *camera_motion_, reference);
  depth_delay_.Add(frame, *camera_motion_, reference);
}

void MapTracker::WatchScale(const Rigid3& reference_from_camera) {
  const Eigen::Vector3d step = reference_from_camera.rotation.inverse() * reference_from_camera.translation;
  scale_.Add(last_->frame.view->features().utime_us, step, last_->covariance);
}

void MapTracker::WatchGround(const TrackedFrame& frame, const FramePose& pose) {
  const double interval_s = SinceLast(*frame.view);
  const Rigid3 last_from_current = last_->frame.world_from_camera.Inverse() * frame.world_from_camera;
  const double length = last_from_current.translation.norm();
  if (frame.view->baseline_m() > 0.0 || lost_since_us_ || interval_s <= 0.0 || length == 0.0) return;
  const Eigen::Matrix3d covariance = TranslationCovariance(pose.optimized.information);
  const Eigen::Vector3d direction = last_from_current.rotation.conjugate() * last_from_current.translation / length;
  const double variance_across = 0.5 * (covariance.trace() - direction.dot(covariance * direction));
  ground_.Add(*last_->frame.view, *frame.view,
              {last_from_current, interval_s, std::sqrt(std::max(variance_across, 0.0)) / length,
               pose.evidence != StepEvidence::kWeak});
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
  const int64_t max_unlocated_us = tracked_utime_us_ ? 0 : options_.max_unlocated_us;
  const int64_t max_lost_us = std::max(options_.max_lost_us, max_unlocated_us);
  if (utime_us - *lost_since_us_ <= max_lost_us || !options_.makes_keyframes) return false;
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
  const double near_m = options_.depth.max_baselines * frame.view->baseline_m();
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

// Whether the images leave the length of the way from the reference keyframe open by more than kOpenShare of it.
bool MapTracker::IsWayOpen(const TrackedFrame& frame, const Rigid3& reference_from_camera) const {
  if (!last_ || &last_->frame != &frame) return true;
  const Eigen::Vector3d way_in_camera = reference_from_camera.rotation.conjugate() * reference_from_camera.translation;
  const double variance = way_in_camera.dot(last_->covariance * way_in_camera);  // of the length, times length^2
  return std::sqrt(variance) > kOpenShare * way_in_camera.squaredNorm();
}

// Of a frame that becomes the reference; nullopt: nothing is known of its error. Points of the first one with depth
// stand where it sees them. What two frames have from points that both see cancels between them, if the points err each
// by itself: those of mono were triangulated by a few keyframes and move with these all together, which residuals don't
// show. There, both errors count in full.
std::optional<PoseInfluences> MapTracker::InfluencesOnReference(const TrackedFrame& frame, KeyframeId reference) const {
  const bool has_depth = frame.view->baseline_m() > 0.0;
  if (has_depth && !reference.valid()) return PoseInfluences{};
  if (!last_ || &last_->frame != &frame || !last_->influences) return std::nullopt;
  return ByPoint(*last_->influences, has_depth);
}

// The frame becomes the reference of those to come.
KeyframeObservation MapTracker::MakeKeyframe(TrackedFrame& frame, KeyframeId reference,
                                             const Rigid3& reference_from_camera) {
  KeyframeObservation keyframe;
  keyframe.id = next_keyframe_;
  keyframe.features = frame.view->features();
  // The focal lengths of the source: the mapper may have found others since. Keypoints stay where the lens moved them.
  keyframe.features.calibration = calibration_;
  keyframe.features.calibration.radial = frame.view->calibration().radial;
  keyframe.world_from_camera = frame.world_from_camera;
  keyframe.reference = reference;
  keyframe.reference_from_camera = reference_from_camera;
  if (IsWayOpen(frame, reference_from_camera)) {
    keyframe.expected = ExpectFrom(reference, reference_from_camera, keyframe.features.utime_us);
  }
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
  if (!reference.valid()) {
    way_corrections_.BeginPart(frame.view->baseline_m() == 0.0);
  } else if (last_ && &last_->frame == &frame && last_->pose_covariance) {
    way_corrections_.Send(reference, keyframe.id, reference_from_camera, *last_->pose_covariance);
  }
  reference_ = keyframe.id;
  reference_influences_ = InfluencesOnReference(frame, reference);
  reference_frame_ = frame;
  camera_motion_at_reference_ = camera_motion_;
  ++next_keyframe_.value;
  if (last_) last_->reference_from_camera = Rigid3::Identity();
  return keyframe;
}

// Until the mapper answers, keypoints with depth are points of their own.
void MapTracker::AddDepthPoints(TrackedFrame& frame, KeyframeId id, SentKeyframe& sent) const {
  const auto sees_known = [&frame](int32_t i) { return frame.points[Index(i)].valid(); };
  for (const auto& [keypoint, point] : NewDepthPoints(frame.view->features(), sees_known, options_.depth)) {
    const Landmark in_camera = PointOf(*frame.view, keypoint, point);
    sent.points[keypoint] = in_camera;
    frame.points[Index(keypoint)] = {{{}, id, keypoint}, InWorld(Sim3::From(frame.world_from_camera), in_camera)};
  }
}

// Mono, after a wide step: until the mapper answers, what this keyframe and its reference see is known by them. At the
// next step it may be all that is left in view.
void MapTracker::AddPairPoints(TrackedFrame& frame, KeyframeObservation& keyframe, SentKeyframe& sent) const {
  const bool is_wide = last_ && &last_->frame == &frame && last_->is_wide_step;
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
