#include "tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace tessera {
namespace {

constexpr int kMinSharedLocal = 5;  // landmarks that a keyframe of the local map shares with its centre

// Smaller of the middle values.
double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<LandmarkId> LandmarksByKeypoint(int num_keypoints, const FoundPose& found,
                                            const std::vector<LocalLandmark>& local) {
  std::vector<LandmarkId> landmarks(static_cast<size_t>(num_keypoints));
  for (const Match& match : found.inliers) {
    landmarks[static_cast<size_t>(match.second)] = local[static_cast<size_t>(match.first)].id;
  }
  return landmarks;
}

}  // namespace

Tracker::Tracker(const TrackerOptions& options) : options_(options), initializer_(options.initializer) {
  if (const std::string sentence = options.Check(); !sentence.empty()) {
    throw std::invalid_argument(sentence);
  }
}

TrackingResult Tracker::Track(const FeatureFrame& features) {
  const Frame frame = std::make_shared<const FrameView>(features, options_.sigma_px, options_.rgbd_baseline_m);
  const int64_t first_new = map_.newest().value + 1;
  std::optional<FoundPose> found = Locate(*frame);
  if (found) {
    CountSeen(*found);
    Remember(*frame, *found);
    if (IsKeyframeDue(*frame, *found)) {
      MakeKeyframe(frame, *found);
    }
  } else if (++num_lost_; map_.empty() || num_lost_ > options_.max_lost_frames) {
    found = Begin(frame);
  }
  return Report(*frame, found, first_new);
}

// --- where the frame is ---------------------------------------------------------------------------

std::optional<FoundPose> Tracker::Locate(const FrameView& frame) {
  if (map_.empty()) {
    return std::nullopt;
  }
  std::optional<Rigid3> guess = num_lost_ == 0 ? GuessByMotion(frame) : std::nullopt;
  if (!guess) {
    guess = GuessByKeyframes(frame);
  }
  if (!guess) {
    return std::nullopt;
  }
  return SearchPose(frame, local_, *guess, options_.search.refined_radius_px, options_.search);
}

std::optional<Rigid3> Tracker::GuessByMotion(const FrameView& frame) const {
  const double radius_px = options_.search.predicted_radius_px;
  const Rigid3 predicted = Predict(frame);
  std::optional<FoundPose> found = SearchPose(frame, last_seen_, predicted, radius_px, options_.search);
  if (!found) {
    found = SearchPose(frame, local_, predicted, options_.wide_radius_factor * radius_px, options_.search);
  }
  if (!found) {  // the motion may have stopped suddenly
    found = SearchPose(frame, local_, last_camera_from_world_, options_.wide_radius_factor * radius_px, options_.search);
  }
  return found ? std::optional(found->camera_from_world) : std::nullopt;
}

std::optional<Rigid3> Tracker::GuessByKeyframes(const FrameView& frame) {
  // The keyframe that the last pose stood by, then the newest ones.
  std::vector<KeyframeId> candidates = {reference_};
  for (KeyframeId id = map_.newest();
       id.valid() && static_cast<int>(candidates.size()) < options_.num_relocalization_keyframes; --id.value) {
    if (id != reference_ && map_.keyframes().Has(id)) {
      candidates.push_back(id);
    }
  }
  const auto seed = static_cast<uint64_t>(frame.features().frame.value);
  for (const KeyframeId candidate : candidates) {
    const std::optional<Rigid3> guess = PoseFromKeyframe(frame, map_, candidate, seed, options_.search);
    if (!guess) {
      continue;
    }
    SelectLocalMap(candidate);
    const double radius_px = options_.search.predicted_radius_px;
    if (const auto found = SearchPose(frame, local_, *guess, radius_px, options_.search)) {
      return found->camera_from_world;
    }
  }
  return std::nullopt;
}

Rigid3 Tracker::Predict(const FrameView& frame) const {
  const auto num_frames = static_cast<double>(frame.features().frame.value - last_frame_.value);
  return Interpolate(Rigid3::Identity(), motion_, num_frames) * last_camera_from_world_;
}

void Tracker::CountSeen(const FoundPose& found) {
  for (size_t i = 0; i < local_.size(); ++i) {
    map_.landmark(local_[i].id).num_expected += found.is_expected[i];
  }
  for (const Match& match : found.inliers) {
    ++map_.landmark(local_[static_cast<size_t>(match.first)].id).num_found;
  }
  most_seen_ = std::max(most_seen_, found.inliers.size());
}

void Tracker::Remember(const FrameView& frame, const FoundPose& found) {
  const FrameId id = frame.features().frame;
  motion_ = Rigid3::Identity();
  if (last_frame_.valid() && num_lost_ == 0 && id > last_frame_) {
    const double share = 1.0 / static_cast<double>(id.value - last_frame_.value);
    motion_ = Interpolate(motion_, found.camera_from_world * last_camera_from_world_.Inverse(), share);
  }
  last_frame_ = id;
  last_camera_from_world_ = found.camera_from_world;
  num_lost_ = 0;
  last_seen_.clear();
  for (const Match& match : found.inliers) {
    last_seen_.push_back(local_[static_cast<size_t>(match.first)]);
  }
}

// --- the start ------------------------------------------------------------------------------------

std::optional<FoundPose> Tracker::Begin(const Frame& frame) {
  const bool has_begun = frame->baseline_m() > 0.0 ? BeginFromRight(frame) : BeginFromTwoViews(frame);
  if (!has_begun) {
    return std::nullopt;
  }
  const KeyframeId newest = map_.newest();
  SelectLocalMap(newest);
  FoundPose found{map_.keyframe(newest).camera_from_world, {}, {}, static_cast<int>(local_.size())};
  for (size_t i = 0; i < local_.size(); ++i) {
    const auto& sightings = map_.landmark(local_[i].id).sightings;
    if (sightings.back().keyframe == newest) {
      found.inliers.push_back({static_cast<int32_t>(i), sightings.back().keypoint, 0});
    }
  }
  most_seen_ = found.inliers.size();
  Remember(*frame, found);
  return found;
}

bool Tracker::BeginFromTwoViews(const Frame& frame) {
  const std::optional<MonoStart> start = initializer_.Add(frame);
  if (!start) {
    return false;
  }
  // A new part after a loss goes on at the last pose, in the scale of the part before.
  const Rigid3 camera_from_world = last_frame_.valid() ? last_camera_from_world_ : Rigid3::Identity();
  const double scale = last_frame_.valid() ? MedianDepth(map_, reference_).value_or(1.0) : 1.0;
  const Rigid3 world_from_camera = camera_from_world.Inverse();
  const Rigid3 second_from_first{start->second_from_first.rotation, scale * start->second_from_first.translation};
  const KeyframeId first = map_.AddKeyframe(start->first, camera_from_world, {}, {});
  const KeyframeId second = map_.AddKeyframe(start->second, second_from_first * camera_from_world, first, {});
  const Eigen::Matrix3d turn = world_from_camera.rotation.toRotationMatrix();
  for (const MonoStart::Point& point : start->points) {
    PointRefinement in_world = point.point;
    in_world.point_in_world = world_from_camera * (scale * point.point.point_in_world);
    in_world.covariance = scale * scale * turn * point.point.covariance * turn.transpose();
    map_.AddLandmark(in_world, {{first, point.keypoint_first}, {second, point.keypoint_second}});
  }
  initializer_ = MonoInitializer(options_.initializer);
  last_frame_ = start->first->features().frame;  // so that the motion between the two is carried on
  last_camera_from_world_ = camera_from_world;
  num_lost_ = 0;
  return true;
}

bool Tracker::BeginFromRight(const Frame& frame) {
  const Rigid3 camera_from_world = last_frame_.valid() ? last_camera_from_world_ : Rigid3::Identity();
  const KeyframeId id = map_.AddKeyframe(frame, camera_from_world, {}, {});
  if (MakeLandmarksFromRight(map_, id, options_.landmark) < options_.initializer.min_matches) {
    map_.RemoveKeyframe(id);
    return false;
  }
  return true;
}

// --- keyframes ------------------------------------------------------------------------------------

bool Tracker::IsKeyframeDue(const FrameView& frame, const FoundPose& found) const {
  const KeyframeOptions& due = options_.keyframe;
  const FeatureFrame& last = map_.keyframe(reference_).view->features();
  const double interval_s = 1e-6 * static_cast<double>(frame.features().utime_us - last.utime_us);
  const double seen_share = static_cast<double>(found.inliers.size()) / static_cast<double>(most_seen_);
  if (seen_share < due.low_seen_share) {
    return true;
  }
  const double parallax_rad = MedianParallax(found);
  return parallax_rad > due.max_parallax_rad ||
         (parallax_rad > due.min_parallax_rad && (seen_share < due.min_seen_share || interval_s > due.max_interval_s));
}

double Tracker::MedianParallax(const FoundPose& found) const {
  const Eigen::Vector3d here = found.camera_from_world.Inverse().translation;
  const Eigen::Vector3d there = map_.keyframe(reference_).camera_from_world.Inverse().translation;
  std::vector<double> cosines;
  for (const Match& match : found.inliers) {
    cosines.push_back(CosParallax(local_[static_cast<size_t>(match.first)].position_in_world, here, there));
  }
  return std::acos(std::clamp(Median(std::move(cosines)), -1.0, 1.0));
}

void Tracker::MakeKeyframe(const Frame& frame, const FoundPose& found) {
  const KeyframeId id = map_.AddKeyframe(frame, found.camera_from_world, reference_,
                                         LandmarksByKeypoint(frame->size(), found, local_));
  CullLandmarks(map_, id, options_.landmark);
  MakeLandmarksFromRight(map_, id, options_.landmark);
  TriangulateLandmarks(map_, id, options_.landmark);
  RefineLandmarks(map_, id);
  ForgetOldKeyframes();
  SelectLocalMap(id);
  most_seen_ = 0;
}

void Tracker::SelectLocalMap(KeyframeId center) {
  reference_ = center;
  std::vector<KeyframeId> keyframes = map_.Covisible(center, kMinSharedLocal, options_.num_local_keyframes);
  keyframes.push_back(center);
  std::vector<LandmarkId> ids;
  for (const KeyframeId keyframe : keyframes) {
    const std::vector<LandmarkId>& seen = map_.keyframe(keyframe).landmarks;
    std::copy_if(seen.begin(), seen.end(), std::back_inserter(ids), [](LandmarkId id) { return id.valid(); });
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  local_.clear();
  for (const LandmarkId id : ids) {
    local_.push_back(MakeLocalLandmark(id, map_.landmark(id)));
  }
}

void Tracker::ForgetOldKeyframes() {
  for (KeyframeId id{0}; map_.keyframes().size() > options_.max_keyframes; ++id.value) {
    if (map_.keyframes().Has(id)) {
      map_.RemoveKeyframe(id);
    }
  }
}

// --- what is told ---------------------------------------------------------------------------------

TrackingResult Tracker::Report(const FrameView& frame, const std::optional<FoundPose>& found,
                               int64_t first_new) const {
  TrackingResult result;
  PoseEstimate& pose = result.pose;
  pose.frame = frame.features().frame;
  pose.utime_us = frame.features().utime_us;
  pose.arrival_us = frame.features().arrival_us;
  pose.num_features = frame.size();
  pose.num_landmarks = static_cast<int32_t>(map_.landmarks().size());
  result.num_keyframes = map_.keyframes().size();
  if (!found) {
    pose.state = map_.empty() ? TrackingState::kInitializing : TrackingState::kLost;
    return result;
  }
  pose.state = TrackingState::kTracked;
  pose.world_from_camera = found->camera_from_world.Inverse();
  pose.reference_keyframe = reference_;
  pose.reference_from_camera = map_.keyframe(reference_).camera_from_world * pose.world_from_camera;
  pose.num_matches = found->num_matches;
  pose.num_inliers = static_cast<int32_t>(found->inliers.size());
  pose.is_keyframe = first_new <= map_.newest().value;
  for (KeyframeId id{first_new}; id <= map_.newest(); ++id.value) {
    const OdometryKeyframe& keyframe = map_.keyframe(id);
    result.keyframes.push_back({id, keyframe.view->features(), keyframe.camera_from_world.Inverse(),
                                keyframe.landmarks, keyframe.reference, keyframe.reference_from_camera, {}});
  }
  return result;
}

}  // namespace tessera
