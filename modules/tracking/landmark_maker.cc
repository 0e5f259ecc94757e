#include "tracking/landmark_maker.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "tracking/association.h"

namespace tessera {
namespace {

constexpr int kMinShared = 15;  // landmarks that make two keyframes neighbours

std::vector<int32_t> FreeKeypoints(const OdometryKeyframe& keyframe) {
  std::vector<int32_t> free;
  for (size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    if (!keyframe.landmarks[i].valid()) {
      free.push_back(static_cast<int32_t>(i));
    }
  }
  return free;
}

std::vector<char> FreeMarks(const OdometryKeyframe& keyframe) {
  std::vector<char> marks(keyframe.landmarks.size());
  std::transform(keyframe.landmarks.begin(), keyframe.landmarks.end(), marks.begin(),
                 [](LandmarkId id) { return static_cast<char>(!id.valid()); });
  return marks;
}

// Whether the sizes at which two views show a point fit its distances from them.
bool AgreesWithScale(const PointView& a, const PointView& b, int level_a, int level_b, const Eigen::Vector3d& point) {
  constexpr double kMaxFactor = 1.5 * kLevelScale;  // half a level of rounding each, and slant
  const double distance_ratio = (a.camera_from_world * point).norm() / (b.camera_from_world * point).norm();
  const double scale_ratio = ScaleOfLevel(level_b) / ScaleOfLevel(level_a);
  return distance_ratio < kMaxFactor * scale_ratio && scale_ratio < kMaxFactor * distance_ratio;
}

// The point that two keypoints show, if they agree on it and see it under enough parallax.
std::optional<PointRefinement> TriangulatePair(const OdometryMap& map, const Sighting& first, const Sighting& second,
                                               const LandmarkOptions& options) {
  const OdometryKeyframe& a = map.keyframe(first.keyframe);
  const OdometryKeyframe& b = map.keyframe(second.keyframe);
  const Rigid3 world_from_a = a.camera_from_world.Inverse();
  const std::optional<Eigen::Vector3d> in_a = TriangulateRays(
      b.camera_from_world * world_from_a, a.view->ray(first.keypoint), b.view->ray(second.keypoint));
  if (!in_a || in_a->z() <= 0.0 || (b.camera_from_world * (world_from_a * *in_a)).z() <= 0.0) {
    return std::nullopt;
  }
  const std::vector<PointView> views = map.Views({first, second});
  const std::optional<PointRefinement> refined =
      RefinePoint(a.view->calibration(), a.view->baseline_m(), views, world_from_a * *in_a);
  if (!refined || refined->max_chi2 > Chi2Limit(false)) {
    return std::nullopt;
  }
  const double cosine = CosParallax(refined->point_in_world, world_from_a.translation,
                                    b.camera_from_world.Inverse().translation);
  const bool has_right = views[0].seen.has_right() || views[1].seen.has_right();
  if (!has_right && cosine > std::cos(options.min_parallax_rad)) {
    return std::nullopt;
  }
  const bool agrees = AgreesWithScale(views[0], views[1], a.view->keypoint(first.keypoint).level,
                                      b.view->keypoint(second.keypoint).level, refined->point_in_world);
  return agrees ? refined : std::nullopt;
}

// Landmarks made with one neighbour.
std::vector<LandmarkId> TriangulateWith(OdometryMap& map, KeyframeId keyframe_id, KeyframeId neighbour_id,
                                        double median_depth, const LandmarkOptions& options) {
  const OdometryKeyframe& keyframe = map.keyframe(keyframe_id);
  const OdometryKeyframe& neighbour = map.keyframe(neighbour_id);
  const Rigid3 neighbour_from_keyframe = neighbour.camera_from_world * keyframe.camera_from_world.Inverse();
  if (neighbour_from_keyframe.translation.norm() < options.min_baseline_share * median_depth) {
    return {};
  }
  EpipolarOptions epipolar;
  epipolar.min_depth = options.min_depth_share * median_depth;
  epipolar.matching = options.matching;
  std::vector<LandmarkId> made;
  for (const Match& match : MatchAlongEpipolarLines(*keyframe.view, FreeKeypoints(keyframe), *neighbour.view,
                                                    FreeMarks(neighbour), neighbour_from_keyframe, epipolar)) {
    const Sighting here{keyframe_id, match.first}, there{neighbour_id, match.second};
    if (const std::optional<PointRefinement> point = TriangulatePair(map, here, there, options)) {
      made.push_back(map.AddLandmark(*point, {here, there}));
    }
  }
  return made;
}

// Looks for landmarks in one more keyframe. What it saw as another landmark already is the same one.
void ExtendInto(OdometryMap& map, KeyframeId neighbour_id, const std::vector<LandmarkId>& ids,
                const LandmarkOptions& options) {
  std::vector<LocalLandmark> landmarks;
  for (const LandmarkId id : ids) {
    if (map.landmarks().Has(id) && !map.Sees(neighbour_id, id)) {
      landmarks.push_back(MakeLocalLandmark(id, map.landmark(id)));
    }
  }
  const OdometryKeyframe& neighbour = map.keyframe(neighbour_id);
  AssociationOptions association;
  association.radius_px = options.extend_radius_px;
  association.matching = options.matching;
  for (const Match& match :
       AssociateByProjection(landmarks, neighbour.camera_from_world, *neighbour.view, association).matches) {
    const LandmarkId id = landmarks[static_cast<size_t>(match.first)].id;
    const LandmarkId there = neighbour.landmarks[static_cast<size_t>(match.second)];
    if (there.valid()) {
      map.Merge(id, there);
    } else {
      map.AddSighting(id, {neighbour_id, match.second});
    }
  }
}

// nullopt if the sightings don't fix the landmark. Sightings that disagree are taken from it, the worst first.
std::optional<PointRefinement> RefineLandmark(OdometryMap& map, LandmarkId id) {
  constexpr int kMaxDropped = 3;  // in one go; a landmark with more wrong sightings than that is hardly one point
  for (int dropped = 0; dropped <= kMaxDropped; ++dropped) {
    const OdometryLandmark& landmark = map.landmark(id);
    const std::vector<PointView> views = map.Views(landmark.sightings);
    const bool has_right = std::any_of(views.begin(), views.end(), [](const auto& v) { return v.seen.has_right(); });
    if (views.empty() || (views.size() < 2 && !has_right)) {
      return std::nullopt;
    }
    const FrameView& view = *map.keyframe(landmark.sightings.front().keyframe).view;
    const std::optional<PointRefinement> refined =
        RefinePoint(view.calibration(), view.baseline_m(), views, landmark.position_in_world);
    if (!refined) {
      return std::nullopt;
    }
    const auto worst = static_cast<size_t>(refined->worst_view);
    if (refined->max_chi2 <= Chi2Limit(views[worst].seen.has_right())) {
      return refined;
    }
    map.RemoveSighting(id, landmark.sightings[worst].keyframe);
  }
  return std::nullopt;
}

}  // namespace

std::string LandmarkOptions::Check() const {
  if (num_neighbours < 1 || !(min_baseline_share > 0.0) || !(min_parallax_rad > 0.0) || !(min_depth_share > 0.0) ||
      !(max_depth_baselines > 0.0) || num_extended < 0 || !(extend_radius_px > 0.0) || trial_keyframes < 1) {
    return "the options of new landmarks must be positive";
  }
  return "";
}

int MakeLandmarksFromRight(OdometryMap& map, KeyframeId keyframe_id, const LandmarkOptions& options) {
  const OdometryKeyframe& keyframe = map.keyframe(keyframe_id);
  const FrameView& view = *keyframe.view;
  const Rigid3 world_from_camera = keyframe.camera_from_world.Inverse();
  int num_made = 0;
  for (const int32_t i : FreeKeypoints(keyframe)) {
    const auto point = PointFromDisparity(view.calibration(), view.baseline_m(), view.observation(i));
    if (!point || point->z() > options.max_depth_baselines * view.baseline_m()) {
      continue;
    }
    const std::vector<PointView> views = map.Views({{keyframe_id, i}});
    const auto refined = RefinePoint(view.calibration(), view.baseline_m(), views, world_from_camera * *point);
    if (refined) {
      map.AddLandmark(*refined, {{keyframe_id, i}});
      ++num_made;
    }
  }
  return num_made;
}

int TriangulateLandmarks(OdometryMap& map, KeyframeId keyframe, const LandmarkOptions& options) {
  const std::optional<double> median_depth = MedianDepth(map, keyframe);
  if (!median_depth) {
    return 0;
  }
  const std::vector<KeyframeId> neighbours = map.Covisible(keyframe, kMinShared, options.num_neighbours);
  std::vector<LandmarkId> made;
  for (const KeyframeId neighbour : neighbours) {
    const std::vector<LandmarkId> more = TriangulateWith(map, keyframe, neighbour, *median_depth, options);
    made.insert(made.end(), more.begin(), more.end());
  }
  const size_t num_extended = std::min(neighbours.size(), static_cast<size_t>(options.num_extended));
  for (size_t i = 0; i < num_extended; ++i) {
    ExtendInto(map, neighbours[i], made, options);
  }
  return static_cast<int>(made.size());
}

void RefineLandmarks(OdometryMap& map, KeyframeId keyframe) {
  const std::vector<LandmarkId> seen = map.keyframe(keyframe).landmarks;
  for (const LandmarkId id : seen) {
    if (!id.valid() || !map.landmarks().Has(id)) {
      continue;
    }
    if (const std::optional<PointRefinement> refined = RefineLandmark(map, id)) {
      map.Describe(id, *refined);
    } else {
      map.RemoveLandmark(id);
    }
  }
}

void CullLandmarks(OdometryMap& map, KeyframeId newest, const LandmarkOptions& options) {
  std::vector<LandmarkId> culled;
  map.landmarks().ForEach([&](LandmarkId id, const OdometryLandmark& landmark) {
    const int64_t age = newest.value - landmark.birth.value;
    if (age > options.trial_keyframes) {
      return;
    }
    const bool is_missed = static_cast<double>(landmark.num_found) <
                           options.min_found_share * static_cast<double>(landmark.num_expected);
    const Sighting& any = landmark.sightings.front();
    const bool has_right = map.keyframe(any.keyframe).view->observation(any.keypoint).has_right();
    const int enough = options.min_sightings_after_trial - (has_right ? 1 : 0);
    if (is_missed || (age == options.trial_keyframes && static_cast<int>(landmark.sightings.size()) < enough)) {
      culled.push_back(id);
    }
  });
  for (const LandmarkId id : culled) {
    map.RemoveLandmark(id);
  }
}

std::optional<double> MedianDepth(const OdometryMap& map, KeyframeId keyframe_id) {
  const OdometryKeyframe& keyframe = map.keyframe(keyframe_id);
  std::vector<double> depths;
  for (const LandmarkId id : keyframe.landmarks) {
    if (id.valid()) {
      depths.push_back((keyframe.camera_from_world * map.landmark(id).position_in_world).z());
    }
  }
  if (depths.empty()) {
    return std::nullopt;
  }
  const auto middle = depths.begin() + static_cast<ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle > 0.0 ? std::optional(*middle) : std::nullopt;
}

}  // namespace tessera
